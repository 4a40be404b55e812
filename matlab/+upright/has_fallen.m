function fallen = has_fallen(p, state)
%HAS_FALLEN  Whether the pole or the cart left its limits.
%   fallen = upright.has_fallen(p, state) returns n-by-1 logicals for the rows of state, n-by-4:
%   x [m], x_dot [m/s], theta [rad], theta_dot [rad/s]. A state that is no number has fallen.
%
%   Example:
%     p = upright.parameters();
%     upright.has_fallen(p, [0 0 0.2 0; 0 0 0.21 0; -2.5 0 0 0])     % 0 1 1
%
%   See also upright.parameters, upright.step.
    if size(state, 2) ~= 4
        upright.internal.refuse_state('state', state);
    end
    fallen = ~(abs(state(:, 1)) <= p.position_limit & abs(state(:, 3)) <= p.angle_limit);
end

%!test
%! p = upright.parameters ();
%! s = [0 0 p.angle_limit 0; 0 0 -0.21 0; 2.4 9 0 9; -2.41 0 0 0; NaN 0 0 0];
%! assert (upright.has_fallen (p, s), logical ([0; 1; 0; 1; 1]));
%!error id=upright:badState upright.has_fallen (upright.parameters (), [0; 0; 0; 0])
