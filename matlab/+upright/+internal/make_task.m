function task = make_task(chosen)
%MAKE_TASK  What a run is: cart-pole, noise, start, and when a trial and a run end.
%   task = upright.internal.make_task(chosen) returns the numbers that the options noise, start,
%   steps and trials stand for, having checked them:
%
%     parameters  from upright.parameters
%     noise       from upright.noise_case
%     start       half-widths of the uniform start, 1-by-4
%     steps       N: a trial that lasts this many steps without a fall succeeds
%     trials      a run is at most this many trials
%
%   Example:
%     upright.internal.make_task(upright.internal.task_options())
    starts = struct( ...
        'random', [0.05 0.05 0.05 0.05], ...
        'zero', [0 0 0 0], ...
        'wide', [0.05, 0.05, 6 * (pi / 180), 0.05]);
    upright.internal.require_one_of('start', chosen.start, fieldnames(starts)');
    upright.internal.require('steps', chosen.steps, 1, 1e9, 'whole');
    upright.internal.require('trials', chosen.trials, 1, 1e6, 'whole');
    task = struct( ...
        'parameters', upright.parameters(), ...
        'noise', upright.noise_case(chosen.noise), ...
        'start', starts.(chosen.start), ...
        'steps', chosen.steps, ...
        'trials', chosen.trials);
end

%!error <start is 'lying'> upright.internal.make_task (setfield (upright.internal.task_options (), 'start', 'lying'))
%!error <steps is 0> upright.internal.make_task (setfield (upright.internal.task_options (), 'steps', 0))
%!error <noise is 'loud'> upright.internal.make_task (setfield (upright.internal.task_options (), 'noise', 'loud'))
