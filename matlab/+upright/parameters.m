function p = parameters()
%PARAMETERS  Parameters of the cart-pole: Barto, Sutton & Anderson (1983), Si & Wang (2001).
%   p = upright.parameters() returns a struct with the fields
%
%     gravity         9.8        acceleration due to gravity [m/s^2]
%     cart_mass       1.0        mass of the cart [kg]
%     pole_mass       0.1        mass of the pole [kg]
%     half_length     0.5        half of the pole's length [m]
%     cart_friction   0.0005     friction of the cart on its track, by the sign of x_dot [N]
%     pole_friction   0.000002   viscous friction at the hinge [N m s/rad]
%     force           10         magnitude of a push [N]
%     time_step       0.02       time between two pushes [s]
%     position_limit  2.4        a trial ends when the cart is further from the middle [m]
%     angle_limit     0.2094     a trial ends when the pole leans further: 12 degrees [rad]
%
%   Example:
%     p = upright.parameters();
%     p.half_length = 1;                               % a longer pole
%     state = upright.step(p, [0 0 0.05 0], p.force)
%
%   See also upright.step, upright.has_fallen.
    p = struct( ...
        'gravity', 9.8, ...
        'cart_mass', 1.0, ...
        'pole_mass', 0.1, ...
        'half_length', 0.5, ...
        'cart_friction', 0.0005, ...
        'pole_friction', 0.000002, ...
        'force', 10.0, ...
        'time_step', 0.02, ...
        'position_limit', 2.4, ...
        'angle_limit', 12 * (pi / 180));
end

%!test
%! p = upright.parameters ();
%! assert (p.angle_limit * 180 / pi, 12, 1e-12);
%! assert (p.half_length, 0.5);
