function trajectory = simulate(policy, varargin)
%SIMULATE  Play a policy for one trial, and return the trajectory.
%   trajectory = upright.simulate(policy) starts near upright and ends with a fall or after
%   1,000 steps of 0.02 s. The policy does not learn any further.
%   trajectory = upright.simulate(policy, name, value, ...) changes these options:
%
%     'noise'   noise case (default 'none'; see upright.noise_case)
%     'start'   'random': each of the four within +-0.05 (default), 'zero', 'wide', or a state,
%               1-by-4: x [m], x_dot [m/s], theta [rad], theta_dot [rad/s]
%     'steps'   maximum number of steps (default 1000)
%     'seed'    the same seed gives the same trajectory (default 0)
%     'run'     each number has its own random numbers (default 1)
%
%   The policy is a learned one (result.policy), one read by upright.import_policy, or a
%   function that returns the probability of a push to the right for a 1-by-4 measurement.
%
%   trajectory is a struct, where k is the number of steps it lasted:
%
%     time           (k+1)-by-1 [s]
%     states         (k+1)-by-4, the start first
%     observations   (k+1)-by-4, what the policy observed
%     forces         k-by-1, the applied forces [N]
%     fallen         whether it ended by a fall
%
%   Example: a hand-written rule, and its plot
%     rule = @(o) double(o * [1; 1.5; 20; 3] > 0);
%     t = upright.simulate(rule, 'start', [0 0 0.1 0]);
%     plot(t.time, t.states(:, [1 3])); legend('x [m]', 'theta [rad]');
%
%   See also upright.q_learning, upright.push_probability, upright.import_policy.
    defaults = struct('noise', 'none', 'start', 'random', 'steps', 1000, 'seed', 0, 'run', 1);
    chosen = upright.internal.options(defaults, varargin);
    chosen.trials = 1;
    start = chosen.start;
    if isnumeric(start)
        if ~isequal(size(start), [1 4]) || ~all(isfinite(start))
            error('upright:badState', 'start is %s; it must be a name, or four numbers', ...
                mat2str(start));
        end
        chosen.start = 'zero';
    end
    task = upright.internal.make_task(chosen);
    random = upright.internal.random_streams( ...
        upright.internal.stream_number(chosen.seed, chosen.run));
    draw = @(k) random(1, k);

    p = task.parameters;
    states = zeros(task.steps + 1, 4);
    observations = states;
    forces = zeros(task.steps, 1);
    states(1, :) = upright.internal.draw_start(task.start, draw);
    if isnumeric(start)
        states(1, :) = start;
    end
    observations(1, :) = upright.measure(task.noise, states(1, :), draw);
    history = [];
    fallen = false;
    k = 0;
    while k < task.steps && ~fallen
        k = k + 1;
        if isa(policy, 'function_handle')
            probability = policy(observations(k, :));
        else
            [probability, history] = ...
                upright.push_probability(policy, observations(k, :), history);
        end
        right = draw(1) < probability;
        forces(k) = upright.disturb(task.noise, p.force * (2 * right - 1), draw);
        states(k + 1, :) = upright.step(p, states(k, :), forces(k));
        observations(k + 1, :) = upright.measure(task.noise, states(k + 1, :), draw);
        fallen = upright.has_fallen(p, states(k + 1, :));
    end
    trajectory = struct( ...
        'time', p.time_step * (0:k)', ...
        'states', states(1:k + 1, :), ...
        'observations', observations(1:k + 1, :), ...
        'forces', forces(1:k), ...
        'fallen', fallen);
end

%!test
%! rule = @(o) double (o * [1; 1.5; 20; 3] > 0);
%! t = upright.simulate (rule, 'start', [0 0 0.1 0], 'steps', 500);
%! assert (! t.fallen);
%! assert (size (t.states), [501 4]);
%! assert (t.states(2, :), upright.step (upright.parameters (), [0 0 0.1 0], t.forces(1)));
%! assert (t.time(end), 10, 1e-9);
%!test
%! t = upright.simulate (@(o) 0, 'noise', 'gaussian-0.2', 'seed', 4);
%! assert (t.fallen);
%! assert (t.states(:, [1 2 4]), t.observations(:, [1 2 4]));
%! assert (any (t.states(:, 3) != t.observations(:, 3)));
%!error id=upright:badState upright.simulate (@(o) 0, 'start', [0 0 1])
%!error id=upright:badValue upright.simulate (@(o) 0, 'start', 'lying')
