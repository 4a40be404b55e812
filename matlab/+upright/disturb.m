function force = disturb(noise, force, draw)
%DISTURB  The force that acts, given the commanded force.
%   force = upright.disturb(noise, force, draw) returns n-by-1 forces [N].
%
%     noise   from upright.noise_case
%     force   n-by-1, the commanded force [N]
%     draw    function: draw(k) returns n-by-k numbers, uniform from 0 to 1
%
%   Example:
%     noise = upright.noise_case('actuator-10');
%     upright.disturb(noise, [10; -10], @(k) rand(2, k))
%
%   See also upright.noise_case, upright.measure.
    if noise.actuator > 0
        force = force .* (1 + noise.actuator * (2 * draw(1) - 1));
    end
end

%!test
%! noise = upright.noise_case ('actuator-10');
%! force = upright.disturb (noise, 10 * ones (5000, 1), @(k) rand (5000, k));
%! assert (all (abs (force - 10) <= 1));
%! assert (std (force), 1 / sqrt (3), 0.02);
%!test
%! assert (upright.disturb (upright.noise_case ('none'), -10, @(k) error ('drew')), -10);
