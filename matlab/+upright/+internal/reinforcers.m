function learners = reinforcers(s, count, random)
%REINFORCERS  REINFORCE of many runs in lockstep; upright.reinforce explains the rule.
%   learners = upright.internal.reinforcers(settings, count, random) returns what
%   upright.internal.lockstep takes.
%
%   Example:
%     random = upright.internal.random_streams(1:5);
%     learners = upright.internal.reinforcers(upright.settings('reinforce'), 5, random);
    scales = upright.internal.scales_of(s);
    memories = cell(count, 1);
    for run = 1:count
        memories{run} = upright.internal.new_network(s, random(run, 176));
    end
    steps = zeros(count, 1);                           % of the present trial
    kept = s.kept_steps;
    inputs = zeros(kept * count, 4);                   % of the last steps: for each run a ring
    pushes = false(kept * count, 1);
    probabilities = zeros(kept * count, 1);
    present = [];                                      % the runs whose weights these are,
    layer_1 = cell(1, 4);                              % for each input the weights to all units,
    layer_2 = cell(1, 8);                              % a row for each run
    layer_3 = [];

    learners = struct('begin_trial', @begin_trial, 'act', @act, 'learn', @learn, ...
        'end_trial', @end_trial, 'policy', @policy, 'forget', @forget, 'patience', 0);

    function begin_trial(runs, ~)
        steps(runs) = 0;
        present = [];
    end

    function right = act(runs, observation)
        if ~isequal(runs, present)
            gather_weights(runs);
        end
        input = observation ./ scales;
        hidden = input(:, 1) .* layer_1{1};
        for k = 2:4
            hidden = hidden + input(:, k) .* layer_1{k};
        end
        hidden = upright.internal.isrlu(hidden);
        hidden_2 = hidden(:, 1) .* layer_2{1};
        for k = 2:8
            hidden_2 = hidden_2 + hidden(:, k) .* layer_2{k};
        end
        hidden_2 = upright.internal.isrlu(hidden_2);
        probability = 1 ./ (1 + exp(-s.logit_scale * sum(hidden_2 .* layer_3, 2)));
        right = random(runs, 1) < probability;

        now = steps(runs);
        steps(runs) = now + 1;
        rows = mod(now, kept) + 1 + (runs - 1) * kept;
        inputs(rows, :) = input;
        pushes(rows) = right;
        probabilities(rows) = abs(probability - ~right);
    end

    function learn(varargin)
        % Steps are remembered when they are made.
    end

    function end_trial(runs)
        for run = runs'
            rows = (run - 1) * kept + (1:min(kept, steps(run)))';
            episode = upright.internal.make_episode( ...
                s, steps(run), inputs(rows, :), pushes(rows), probabilities(rows));
            memories{run} = upright.internal.policy_gradient(s, memories{run}, episode);
        end
    end

    function made = policy(run)
        made = upright.internal.reinforce_policy(s, memories{run}.weights);
    end

    function forget()
        memories = {};
        inputs = [];
        pushes = [];
        probabilities = [];
    end

    function gather_weights(runs)
        % Lay the weights of these runs out for arithmetic with all of them at once.
        present = runs;
        all = zeros(numel(runs), 176);
        for row = 1:numel(runs)
            weights = memories{runs(row)}.weights;
            all(row, :) = [reshape(weights{1}', 1, []), reshape(weights{2}', 1, []), weights{3}'];
        end
        for k = 1:4
            layer_1{k} = all(:, 8 * (k - 1) + (1:8));
        end
        for k = 1:8
            layer_2{k} = all(:, 32 + 16 * (k - 1) + (1:16));
        end
        layer_3 = all(:, 161:176);
    end
end
