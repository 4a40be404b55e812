function [chosen, task, draw] = begin_run(agent, pairs)
%BEGIN_RUN  What a learner of one run needs: options, task, and the run's own random numbers.
%   [chosen, task, draw] = upright.internal.begin_run(agent, pairs) checks everything first.
%
%   Example:
%     [chosen, task, draw] = upright.internal.begin_run('q-learning', {'noise', 'none'});
%
%   See also upright.q_learning, upright.reinforce.
    defaults = upright.internal.task_options();
    defaults.run = 1;
    defaults.settings = upright.settings(agent);
    defaults.watch = [];
    chosen = upright.internal.options(defaults, pairs);
    task = upright.internal.make_task(chosen);
    upright.internal.check_settings(agent, chosen.settings);
    if ~isempty(chosen.watch) && ~isa(chosen.watch, 'function_handle')
        error('upright:badValue', 'watch is %s; it must be a function', ...
            upright.internal.shown(chosen.watch));
    end
    random = upright.internal.random_streams( ...
        upright.internal.stream_number(chosen.seed, chosen.run));
    draw = @(k) random(1, k);
end

%!error <watch is 3> upright.internal.begin_run ('reinforce', {'watch', 3})
