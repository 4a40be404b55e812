function study(agent, label, noise, start, steps, trials, seed, runs)
%STUDY  Make runs and print each as a line of JSON, for the program that asked for them.
%   upright.internal.study(agent, label, noise, start, steps, trials, seed, runs), where label is
%   'default' or 'as-published' and runs a row of numbers, from 1. A line begins with 'upright '.
%
%   Example:
%     upright.internal.study('q-learning', 'default', 'none', 'random', 1000, 1000, 0, [1 2])
    upright.run_trials(agent, 'settings', upright.settings(agent, label), 'noise', noise, ...
        'start', start, 'steps', steps, 'trials', trials, 'seed', seed, 'numbers', runs, ...
        'on_run', @tell);
end

function tell(result)
    fprintf('upright %s\n', upright.internal.to_json(struct( ...
        'run', result.run, ...
        'success', result.success, ...
        'lengths', {num2cell(result.lengths)}, ...
        'seconds', result.seconds)));
    upright.internal.flush();
end
