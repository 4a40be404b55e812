function [sine, cosine, rest] = sine_cosine(angle)
%SINE_COSINE  sin and cos of angles [rad], to 2e-15; the same bits on every system.
%   [sine, cosine] = upright.internal.sine_cosine(angle) takes any array. As upright/core/portable_math.py:
%   up to pi/8 a Taylor series; beyond, whole turns are removed, and an eighth of the rest is
%   doubled three times. MATLAB, Octave and Python have other libraries, whose last bits differ,
%   which an unstable cart-pole soon turns into another trajectory.
%   [sine, cosine, rest] = upright.internal.sine_cosine(angle) also returns 1 - cos, which is more
%   exact near 0 than the difference.
%
%   Example:
%     [sine, cosine] = upright.internal.sine_cosine(0.1)
    [sine, rest] = series(angle);
    large = abs(angle) > pi / 8;
    if any(large(:))
        [sine(large), rest(large)] = of_any_angle(angle(large));
    end
    cosine = 1 - rest;
end

function [sine, rest] = series(angle)
    z = angle .* angle;
    z2 = z .* z;
    z4 = z2 .* z2;
    sine = angle + angle .* z .* ((-1 / 6 + z * (1 / 120)) + z2 .* (-1 / 5040 + z * (1 / 362880)) ...
        + z4 .* (-1 / 39916800 + z * (1 / 6227020800)));
    rest = z .* ((1 / 2 + z * (-1 / 24)) + z2 .* (1 / 720 + z * (-1 / 40320)) ...
        + z4 .* (1 / 3628800 + z * (-1 / 479001600)));
end

function [sine, rest] = of_any_angle(angle)
    turn = 2 * pi;
    rest_of_turn = 2.4492935982947064e-16;   % of which 2 * pi falls short
    rounder = 1.5 * 2^52;                    % adding and subtracting it rounds to a whole number
    turns = (angle * (1 / turn) + rounder) - rounder;
    [sine, rest] = series(0.125 * ((angle - turns * turn) - turns * rest_of_turn));
    for doubling = 1:3
        doubled = 2 * sine .* (1 - rest);
        rest = 2 * sine .* sine;
        sine = doubled;
    end
end

%!test
%! angle = linspace (-50, 50, 100001)';
%! [sine, cosine] = upright.internal.sine_cosine (angle);
%! assert (sine, sin (angle), 5e-15);
%! assert (cosine, cos (angle), 5e-15);
%!test
%! angle = linspace (-pi / 8, pi / 8, 10001)';
%! [sine, cosine, rest] = upright.internal.sine_cosine (angle);
%! assert (sine, sin (angle), 2e-16);
%! assert (rest, 1 - cos (angle), 2e-16);
