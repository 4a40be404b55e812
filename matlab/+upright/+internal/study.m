function study(agent, label, noise, start, steps, trials, seed, runs)
%STUDY  Make runs and print each as a line of JSON, for the program that requested them.
%   upright.internal.study(agent, label, noise, start, steps, trials, seed, runs), where label is
%   'default' or 'as-published' and runs a row of numbers, from 1. A line begins with 'upright '. In
%   Octave, it stops after the current run if the program that started it has ended.
%
%   Example:
%     upright.internal.study('q-learning', 'default', 'none', 'random', 1000, 1000, 0, [1 2])
    asked_by = parent();
    upright.run_trials(agent, 'settings', upright.settings(agent, label), 'noise', noise, ...
        'start', start, 'steps', steps, 'trials', trials, 'seed', seed, 'numbers', runs, ...
        'on_run', @(result) tell(result, asked_by));
end

function tell(result, asked_by)
    if parent() ~= asked_by
        error('upright:alone', 'the program that asked for these runs is gone');
    end
    fprintf('upright %s\n', upright.internal.to_json(struct( ...
        'run', result.run, ...
        'success', result.success, ...
        'lengths', {num2cell(result.lengths)}, ...
        'seconds', result.seconds)));
    upright.internal.flush();
end

function number = parent()
    number = 0;
    if exist('OCTAVE_VERSION', 'builtin') > 0
        number = getppid();
    end
end
