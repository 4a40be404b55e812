function state = step(p, state, force)
%STEP  Advance cart-poles by one time step: the equations of motion, explicit Euler.
%   state = upright.step(p, state, force) returns the states p.time_step later.
%
%     p       parameters, from upright.parameters
%     state   n-by-4, a row for each cart-pole: x [m], x_dot [m/s], theta [rad],
%             theta_dot [rad/s]. theta is measured from upright and leans to +x.
%     force   n-by-1 (or one number for all): force on the cart along +x [N]
%
%   These are equations (3) and (4) of the course report, with (3) divided by the total mass,
%   as Barto, Sutton & Anderson (1983) have it and the units demand. The old velocities move
%   the positions. Arithmetic is that of upright/core/cartpole.py, in the same order: the result is
%   the same to the last bit.
%
%   Example: a pole that leans by 3 degrees, pushed to the right for one step
%     p = upright.parameters();
%     state = upright.step(p, [0 0 3 * pi / 180 0], p.force)
%
%   See also upright.parameters, upright.has_fallen, upright.simulate.
    [n, width] = size(state);
    m = numel(force);
    if width ~= 4 || (m ~= n && m ~= 1)
        explain(state, force);
    end
    m = p.pole_mass;
    l = p.half_length;
    x_dot = state(:, 2);
    theta_dot = state(:, 4);
    [sine, cosine] = upright.internal.sine_cosine(state(:, 3));

    mass_inverse = 1 / (p.cart_mass + m);
    moment = m * l;
    drive = (force + moment * theta_dot .* theta_dot .* sine - p.cart_friction * sign(x_dot)) ...
        * mass_inverse;
    theta_acceleration = ...
        (p.gravity * sine - cosine .* drive - (p.pole_friction / moment) * theta_dot) ...
        ./ (l * (4 / 3 - (m * mass_inverse) * (cosine .* cosine)));
    x_acceleration = drive - (moment * mass_inverse) * (theta_acceleration .* cosine);

    state = state + p.time_step * [x_dot, x_acceleration, theta_dot, theta_acceleration];
    total = sum(state(:));
    if total ~= total
        error('upright:notANumber', 'state or force holds NaN; all must be numbers');
    end
end

function explain(state, force)
    if size(state, 2) ~= 4
        upright.internal.refuse_state('state', state);
    end
    error('upright:badForce', ...
        'force is %s of size %s; it must be one number, or one for each row of state (%d)', ...
        class(force), mat2str(size(force)), size(state, 1));
end

%!test  # a hanging pole at rest stays, but for rounding
%! p = upright.parameters ();
%! assert (upright.step (p, [0 0 pi 0], 0), [0 0 pi 0], 1e-15);
%!test  # mirror symmetry, to the last bit
%! p = upright.parameters ();
%! s = [0.3 -0.2 0.1 0.4; -1 2 3 -4];
%! assert (upright.step (p, -s, [-10; 5]), -upright.step (p, s, [10; -5]));
%!test  # many are stepped as one is
%! p = upright.parameters ();
%! s = [0.3 -0.2 0.1 0.4; -1 2 3 -4; 0 0 0.39 0];
%! for k = 1:3, one(k, :) = upright.step (p, s(k, :), 10); end
%! assert (upright.step (p, s, 10), one);
%!error id=upright:badState upright.step (upright.parameters (), [0 0 0], 10)
%!error id=upright:badForce upright.step (upright.parameters (), zeros (3, 4), [1; 2])
%!error id=upright:notANumber upright.step (upright.parameters (), [0 0 NaN 0], 10)
%!error id=upright:notANumber upright.step (upright.parameters (), [0 0 0 0], NaN)
