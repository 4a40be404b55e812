function observation = measure(noise, state, draw)
%MEASURE  What the learner observes of the true state.
%   observation = upright.measure(noise, state, draw) returns n-by-4 measurements.
%
%     noise   from upright.noise_case
%     state   n-by-4: x [m], x_dot [m/s], theta [rad], theta_dot [rad/s]
%     draw    function: draw(k) returns n-by-k numbers, uniform from 0 to 1
%
%   A normal random number is computed from two uniform ones (Box & Muller, 1958).
%
%   Example:
%     noise = upright.noise_case('gaussian-0.1');
%     upright.measure(noise, [0 0 0.05 0], @(k) rand(1, k))
%
%   See also upright.noise_case, upright.disturb.
    observation = state;
    if noise.angle > 0
        observation(:, 3) = state(:, 3) .* (1 + noise.angle * (2 * draw(1) - 1));
    end
    if noise.others > 0
        others = [1, 2, 4];
        observation(:, others) = state(:, others) .* (1 + noise.others * (2 * draw(3) - 1));
    end
    if noise.angle_offset > 0
        uniform = draw(2);
        radius = sqrt(-2 * upright.internal.logarithm(1 - uniform(:, 1)));
        normal = radius .* upright.internal.cosine_of_turns(uniform(:, 2));
        observation(:, 3) = observation(:, 3) + noise.angle_offset * normal;
    end
end

%!test  # only the angle, by the variance asked for
%! noise = upright.noise_case ('gaussian-0.2');
%! seen = upright.measure (noise, ones (20000, 4), @(k) rand (20000, k));
%! assert (seen(:, [1 2 4]), ones (20000, 3));
%! assert (var ((seen(:, 3) - 1) * 180 / pi), 0.2, 0.01);
%! assert (mean (seen(:, 3)), 1, 5e-4);
%!test
%! noise = upright.noise_case ('all-10');
%! seen = upright.measure (noise, ones (5000, 4), @(k) rand (5000, k));
%! assert (std (seen), 0.1 / sqrt (3) * ones (1, 4), 0.002);
