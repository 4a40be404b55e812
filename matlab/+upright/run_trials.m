function results = run_trials(agent, varargin)
%RUN_TRIALS  Make many runs of a learner at once: trials, one after the other, until one succeeds.
%   results = upright.run_trials(agent) makes 20 runs, as the report, and returns a struct array,
%   in the order of the runs. The agent is 'q-learning', 'reinforce' or 'random-search', which
%   draws a new linear policy for every trial, learns nothing, and is what a learner must beat.
%   results = upright.run_trials(agent, name, value, ...) changes these options:
%
%     'runs'      how many runs, numbered from 1, or a row of their numbers (default 20)
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
%   seconds, policy (what was learned, see upright.simulate), and how the run was made. A run
%   depends on its seed and number alone: it draws what rand gives after rng(1e6 * seed + run).
%
%   The runs are made in lockstep: all cart-poles advance together, a row of the state for each.
%   With compiled C they are made one after the other.
%
%   Example:
%     results = upright.run_trials('q-learning', 'runs', 100, 'noise', 'gaussian-0.1');
%     mean([results.trials])
%     upright.plot_learning(results);
%
%   See also upright.table, upright.q_learning, upright.reinforce, upright.build_mex.
    defaults = upright.internal.task_options();
    defaults.runs = 20;
    defaults.settings = upright.settings(agent);
    defaults.on_run = @(result) [];
    defaults.mex = 'built';
    chosen = upright.internal.options(defaults, varargin);
    task = upright.internal.make_task(chosen);
    upright.internal.check_settings(agent, chosen.settings);
    runs = run_numbers(chosen.runs);
    numbers = upright.internal.stream_number(chosen.seed, runs);
    if ~isa(chosen.on_run, 'function_handle')
        error('upright:badValue', 'on_run is %s; it must be a function', ...
            upright.internal.shown(chosen.on_run));
    end

    results = cell(1, numel(runs));
    began = tic;
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
        result.seconds = toc(began);               % of all runs till now
        results{k} = result;
        chosen.on_run(result);
    end
end

function runs = run_numbers(runs)
    if ~isnumeric(runs) || isempty(runs) || numel(runs) ~= size(runs, 2)
        error('upright:badValue', 'runs is %s; it must be a number of runs, or a row of numbers', ...
            upright.internal.shown(runs));
    end
    if isscalar(runs)
        upright.internal.require('runs', runs, 1, 1e6, 'whole');
        runs = 1:runs;
    end
end

function yes = uses_mex(agent, wanted)
    built = ~isempty(upright.internal.built_mex());
    if ischar(wanted)
        upright.internal.require_one_of('mex', wanted, {'built'});
        yes = built && strcmp(agent, 'q-learning');
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
