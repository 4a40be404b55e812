function results = run_trials(agent, varargin)
%RUN_TRIALS  Make many runs of a learner at once: trials, one after the other, until one succeeds.
%   results = upright.run_trials(agent) makes 20 runs, like the report, and returns a struct array
%   in the order of the runs. The agent is 'q-learning', 'reinforce' or 'random-search', which
%   draws a new linear policy for every trial, learns nothing, and is the baseline to beat.
%   results = upright.run_trials(agent, name, value, ...) changes these options:
%
%     'runs'      number of runs (default 20)
%     'numbers'   which runs: a row of numbers (default 1 to the number of runs)
%     'noise'     noise case (default 'none'; see upright.noise_case)
%     'start'     'random': each of the four within +-0.05 (default), 'zero', or 'wide'
%     'steps'     N: a trial of this many steps of 0.02 s succeeds (default 60000)
%     'trials'    a run is at most this many trials (default 1000)
%     'seed'      the same seed gives the same results (default 0)
%     'settings'  from upright.settings(agent)
%     'on_run'    function called with the result of each run as it ends
%     'mex'       whether Q-learning runs in compiled C: true, false, or 'built' (default):
%                 if upright.build_mex was called. The results are the same.
%
%   Each result has the fields success, trials (how many there were), lengths (steps of each),
%   seconds (since the previous run ended), policy (what was learned, see upright.simulate), and
%   the options of the run. A run depends only on its seed and its number: it draws the numbers
%   that rand gives after rng(1e6 * seed + run).
%
%   The runs are made in lockstep: all cart-poles advance together, a row of the state for each.
%   With compiled C, they are made one after the other.
%
%   Example:
%     results = upright.run_trials('q-learning', 'runs', 100, 'noise', 'gaussian-0.1');
%     mean([results.trials])
%     upright.plot_learning(results);
%
%   See also upright.table, upright.q_learning, upright.reinforce, upright.build_mex.
    defaults = upright.internal.task_options();
    defaults.runs = 20;
    defaults.numbers = [];
    defaults.settings = upright.settings(agent);
    defaults.on_run = @(result) [];
    defaults.mex = 'built';
    chosen = upright.internal.options(defaults, varargin);
    task = upright.internal.make_task(chosen);
    upright.internal.check_settings(agent, chosen.settings);
    runs = run_numbers(chosen);
    numbers = upright.internal.stream_number(chosen.seed, runs);
    if ~isa(chosen.on_run, 'function_handle')
        error('upright:badValue', 'on_run is %s; it must be a function', ...
            upright.internal.shown(chosen.on_run));
    end

    results = cell(1, numel(runs));
    began = tic;
    told = 0;                                          % when the last run ended [s]
    if uses_mex(agent, chosen.mex)
        for k = 1:numel(runs)
            [lengths, success, table] = upright.internal.q_learning_mex(task.parameters, ...
                task.noise, task.start, chosen.settings, numbers(k), task.steps, task.trials);
            keep(k, success, lengths, upright.internal.table_policy(chosen.settings, table));
        end
    else
        random = upright.internal.random_streams(numbers);
        make = struct('q_learning', @upright.internal.q_learners, ...
            'reinforce', @upright.internal.reinforcers, ...
            'random_search', @upright.internal.random_searchers);
        learners = make.(strrep(agent, '-', '_'))(chosen.settings, numel(runs), random);
        upright.internal.lockstep(learners, task, random, numel(runs), @keep);
    end
    results = [results{:}];

    function keep(k, success, lengths, policy)
        described = chosen;
        described.run = runs(k);
        result = upright.internal.end_run(agent, described, success, lengths, policy);
        now = toc(began);
        result.seconds = now - told;                   % together: of all runs
        told = now;
        results{k} = result;
        chosen.on_run(result);
    end
end

function numbers = run_numbers(chosen)
    upright.internal.require('runs', chosen.runs, 1, 1e6, 'whole');
    numbers = chosen.numbers;
    if isempty(numbers)
        numbers = 1:chosen.runs;
    elseif ~isnumeric(numbers) || numel(numbers) ~= size(numbers, 2)
        error('upright:badValue', 'numbers is %s; it must be a row of numbers', ...
            upright.internal.shown(numbers));
    end
end

function yes = uses_mex(agent, wanted)
    built = strcmp(agent, 'q-learning') && ~isempty(upright.internal.built_mex());
    if ischar(wanted)
        upright.internal.require_one_of('mex', wanted, {'built'});
        yes = built;
        return
    end
    upright.internal.require('mex', wanted, 0, 1, 'whole');
    yes = logical(wanted);
    if yes && ~strcmp(agent, 'q-learning')
        error('upright:noMex', 'agent is ''%s''; only q-learning runs in compiled C', agent);
    end
    if yes && ~built
        error('upright:noMex', 'the compiled C is missing; upright.build_mex() makes it');
    end
end

%!test  # in lockstep each run is what it is alone, whatever the noise and the settings
%! [~, names] = upright.noise_case ();
%! for agent = {'q-learning', 'reinforce'}
%!   learn = str2func (['upright.' strrep(agent{1}, '-', '_')]);
%!   for k = 1:7
%!     options = {'noise', names{k}, 'steps', 120, 'trials', 20, 'seed', k};
%!     together = upright.run_trials (agent{1}, options{:}, 'numbers', [2 9], 'mex', false);
%!     for result = together
%!       alone = learn (options{:}, 'run', result.run);
%!       assert (result.lengths, alone.lengths);
%!       assert (result.success, alone.success);
%!     end
%!   end
%! end
%!test  # as published, learning at every step
%! s = upright.settings ('q-learning', 'as-published');
%! options = {'settings', s, 'steps', 200, 'trials', 30, 'noise', 'sensor-10'};
%! together = upright.run_trials ('q-learning', options{:}, 'runs', 3, 'mex', false);
%! for result = together
%!   alone = upright.q_learning (options{:}, 'run', result.run);
%!   assert (result.lengths, alone.lengths);
%!   assert (result.policy.probabilities, alone.policy.probabilities);
%! end
%!test  # who is told of each run is told once; runs that fail are among the results
%! told = containers.Map ('KeyType', 'double', 'ValueType', 'any');
%! results = upright.run_trials ('random-search', 'runs', 6, 'trials', 4, 'on_run', @(r) subsasgn (told, substruct ('()', {r.run}), r.trials));
%! assert (cell2mat (told.keys ()), 1:6);
%! assert (cell2mat (told.values ()), [results.trials]);
%! assert ([results.run], 1:6);
%! failed = ! [results.success];
%! assert (any (failed));
%! assert ([results(failed).trials], 4 * ones (1, sum (failed)));
%!error <runs is 2x2 double> upright.run_trials ('q-learning', 'runs', ones (2))
%!error <numbers is 2x2 double> upright.run_trials ('q-learning', 'numbers', ones (2))
%!error <run is 0> upright.run_trials ('q-learning', 'numbers', [1 0])
%!error <agent is 'dqn'> upright.run_trials ('dqn')
%!error id=upright:noMex upright.run_trials ('reinforce', 'mex', true)
%!error <mex is 'yes'> upright.run_trials ('q-learning', 'mex', 'yes')
