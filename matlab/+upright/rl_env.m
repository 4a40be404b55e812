function [env, step, reset] = rl_env(varargin)
%RL_ENV  The cart-pole as an environment of MATLAB's Reinforcement Learning Toolbox. UNTESTED.
%   env = upright.rl_env() returns an rlFunctionEnv. GNU Octave, in which this package is tested,
%   lacks the toolbox: only the two functions below have been run, never the environment itself.
%   env = upright.rl_env('noise', 'gaussian-0.1', 'start', 'wide') changes noise case and start.
%   [env, step, reset] = upright.rl_env(...) also returns the two functions that define it; without
%   the toolbox, env is then [].
%
%     observation   4-by-1: x [m], x_dot [m/s], theta [rad], theta_dot [rad/s], with noise
%     action        -10 or 10, the force [N]
%     reward        1 for each step, 0 for the one that ends in a fall
%
%   Random numbers come from rand; rng(seed) makes an experiment reproducible.
%
%   Example:
%     env = upright.rl_env('noise', 'sensor-5');
%     agent = rlDQNAgent(getObservationInfo(env), getActionInfo(env));
%     train(agent, env);
%
%   See also upright.step, upright.measure.
    chosen = upright.internal.options(upright.internal.task_options(), varargin);
    task = upright.internal.make_task(chosen);
    p = task.parameters;
    draw = @(k) rand(1, k);
    step = @advance;
    reset = @begin;
    env = [];
    if exist('rlFunctionEnv', 'file')
        observations = rlNumericSpec([4 1]);
        observations.Name = 'x [m], x_dot [m/s], theta [rad], theta_dot [rad/s]';
        actions = rlFiniteSetSpec([-p.force p.force]);
        actions.Name = 'force [N]';
        env = rlFunctionEnv(observations, actions, step, reset);
    elseif nargout < 2
        error('upright:noToolbox', 'this needs the Reinforcement Learning Toolbox of MATLAB');
    end

    function [observation, reward, done, logged] = advance(force, logged)
        state = upright.step(p, logged.state', upright.disturb(task.noise, force, draw));
        observation = upright.measure(task.noise, state, draw)';
        done = upright.has_fallen(p, state);
        reward = double(~done);
        logged.state = state';
    end

    function [observation, logged] = begin()
        state = upright.internal.draw_start(task.start, draw);
        observation = upright.measure(task.noise, state, draw)';
        logged = struct('state', state');
    end
end

%!error id=upright:noToolbox env = upright.rl_env ();
%!test
%! [env, step, reset] = upright.rl_env ('start', 'zero');
%! [observation, logged] = reset ();
%! assert (observation, zeros (4, 1));
%! [observation, reward, done, logged] = step (10, logged);
%! assert (observation', upright.step (upright.parameters (), [0 0 0 0], 10));
%! assert ([reward, done], [1, 0]);
%! steps = 1;
%! while ! done, [observation, reward, done, logged] = step (10, logged); steps += 1; end
%! assert (reward, 0);
%! assert (steps < 20);
