function learners = random_searchers(s, count, random)
%RANDOM_SEARCHERS  Random search of many runs in lockstep: a new linear policy for every trial.
%   learners = upright.internal.random_searchers(settings, count, random) returns what
%   upright.internal.lockstep takes. A policy pushes right where the weighted sum of the
%   measurements is above zero; nothing is learned, nothing is kept.
%
%   Example:
%     random = upright.internal.random_streams(1:5);
%     learners = upright.internal.random_searchers(upright.settings('random-search'), 5, random);
    scales = upright.internal.scales_of(s);
    weights = zeros(count, 4);

    learners = struct('begin_trial', @begin_trial, 'act', @act, 'learn', @(varargin) [], ...
        'end_trial', @(runs) [], 'policy', @policy, 'forget', @() [], 'patience', 0);

    function begin_trial(runs, ~)
        weights(runs, :) = (2 * random(runs, 4) - 1) ./ scales;
    end

    function right = act(runs, observation)
        parts = weights(runs, :) .* observation;
        total = parts(:, 1) + parts(:, 2);
        right = total + (parts(:, 3) + parts(:, 4)) > 0;
    end

    function made = policy(run)
        made = upright.internal.network_policy({weights(run, :)'}, {'above zero'}, []);
    end
end
