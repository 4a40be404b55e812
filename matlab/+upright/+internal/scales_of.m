function scales = scales_of(s)
%SCALES_OF  What counts as one unit of each measurement: 1-by-4 [m, m/s, rad, rad/s].
%
%   Example:
%     upright.internal.scales_of(upright.settings('random-search'))
    scales = [s.x_scale, s.x_dot_scale, s.theta_scale, s.theta_dot_scale];
end
