function state = draw_start(half_widths, draw)
%DRAW_START  Start states, each component uniform in +- its half-width.
%   state = upright.internal.draw_start(half_widths, draw) returns n-by-4 states.
%
%     half_widths   1-by-4 [m, m/s, rad, rad/s]
%     draw          function: draw(k) returns n-by-k numbers, uniform from 0 to 1
%
%   Example:
%     upright.internal.draw_start([0.05 0.05 0.05 0.05], @(k) rand(3, k))
    state = half_widths .* (2 * draw(4) - 1);
end

%!assert (all (all (abs (upright.internal.draw_start ([1 2 3 4], @(k) rand (100, k))) <= [1 2 3 4])))
