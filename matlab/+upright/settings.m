function s = settings(agent, label)
%SETTINGS  The settings of a learner, which you can change and pass to it.
%   s = upright.settings(agent, label) returns a struct. The agent is 'q-learning', 'reinforce' or
%   'random-search'; the label is 'default' (tuned) or 'as-published' (the report's learning rate
%   and discount). Names and values are those of the Python package, where `upright agents
%   q-learning` describes each setting.
%
%   Example: a learning rate of 0.2
%     s = upright.settings('q-learning');
%     s.learning_rate = 0.2;
%     result = upright.q_learning('settings', s);
%
%   See also upright.q_learning, upright.reinforce, upright.run_trials.
    if nargin < 2
        label = 'default';
    end
    agents = struct('name', {'q-learning', 'reinforce', 'random-search'}, ...
        'make', {@q_learning, @reinforce, @random_search});
    upright.internal.require_one_of('agent', agent, {agents.name});
    upright.internal.require_one_of('settings', label, {'default', 'as-published'});
    make = agents(strcmp(agent, {agents.name})).make;
    s = make(strcmp(label, 'as-published'));
end

function s = q_learning(as_published)
    degree = pi / 180;
    s = struct( ...
        'learning_rate', 0.08, ...     % alpha: how far a value moves towards the new one
        'discount', 0.99, ...          % gamma: how much less a fall counts a move ahead
        'replay_passes', 2, ...        % over the kept moves after a fall; 0: learn at every step
        'replay_size', 2000, ...       % how many of the last moves between boxes are kept
        'trace_decay', 0.15, ...       % lambda: how much of the next move's value passes on
        'mirrored', true, ...          % whether a box and its mirror image share their values
        'jitter', 1e-6, ...            % width of the random first values, which breaks ties
        'x_edges', [-1.6 1.6], ...                                           % [m]
        'x_dot_edges', 0, ...                                                % [m/s]
        'theta_edges', [-3 -1 1 3] * degree, ...                             % [rad]
        'theta_dot_edges', [-50 -30 -12 0 12 30 50] * degree);               % [rad/s]
    if as_published
        s.learning_rate = 0.3;
        s.discount = 0.9;
        s.replay_passes = 0;
        s.replay_size = 1;
        s.trace_decay = 0;
        s.mirrored = false;
        s.x_edges = [-0.8 0.8];        % the 162 boxes of Barto, Sutton & Anderson (1983)
        s.x_dot_edges = [-0.5 0.5];
        s.theta_edges = [-6 -1 0 1 6] * degree;
        s.theta_dot_edges = [-50 50] * degree;
    end
end

function s = reinforce(as_published)
    s = struct( ...
        'learning_rate', 0.01, ...     % step size of Adam
        'discount', 0.99, ...          % gamma: how much less a push counts a step before the fall
        'baseline', 'fitted', ...      % returns are compared with their 'mean', or a regression
        'episodes', 8, ...             % how many of the last episodes an update learns from
        'kept_steps', 1000, ...        % only this many last steps of an episode are kept
        'epochs', 12, ...              % steps of Adam in one update
        'stride', 3, ...               % each step of Adam uses every n-th kept step
        'beta1', 0.5, ...              % Adam's beta 1
        'beta2', 0.97, ...             % Adam's beta 2
        'weight_decay', 0.01, ...      % fraction of each weight lost in a step of Adam
        'init_std', 0.6, ...           % of the first weights, times the root of the inputs' number
        'logit_scale', 3, ...          % from the last sum to the log-odds of a push to the right
        'x_scale', 3.6, ...            % what counts as one unit of input [m]
        'x_dot_scale', 2.2, ...        % [m/s]
        'theta_scale', 6 * (pi / 180), ...   % [rad]
        'theta_dot_scale', 0.35);      % [rad/s]
    if as_published
        s.learning_rate = 0.1;
        s.discount = 0.97;
        s.baseline = 'mean';
        s.episodes = 1;
        s.kept_steps = 60000;
        s.epochs = 1;
        s.stride = 1;
        s.beta1 = 0.9;
        s.beta2 = 0.999;
        s.weight_decay = 0;
        s.init_std = 1;
        s.logit_scale = 1;
        s.x_scale = 1;
        s.x_dot_scale = 1;
        s.theta_scale = 1;
        s.theta_dot_scale = 1;
    end
end

function s = random_search(~)
    s = struct( ...
        'x_scale', 2.4, ...            % what counts as one unit of input [m]
        'x_dot_scale', 1.5, ...        % [m/s]
        'theta_scale', 6 * (pi / 180), ...   % [rad]
        'theta_dot_scale', 0.5);       % [rad/s]
end

%!test
%! s = upright.settings ('q-learning');
%! assert (s.learning_rate, 0.08);
%! s = upright.settings ('q-learning', 'as-published');
%! assert ([s.learning_rate, s.discount], [0.3, 0.9]);
%!error id=upright:badValue upright.settings ('dqn')
%!error id=upright:badValue upright.settings ('reinforce', 'best')
