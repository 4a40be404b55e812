function defaults = task_options()
%TASK_OPTIONS  The options that every learner takes, with their defaults: the report's protocol.
%
%   Example:
%     defaults = upright.internal.task_options()
    defaults = struct('noise', 'none', 'start', 'random', 'steps', 60000, 'trials', 1000, 'seed', 0);
end
