function [noise, names] = noise_case(name)
%NOISE_CASE  What disturbs the force and the measured angle, by name.
%   noise = upright.noise_case(name) returns a struct; zero means that there is none:
%
%     actuator      p: the force that acts is F (1 + u), u uniform in +-p, drawn at each step
%     angle         p: the measured angle is theta (1 + u), u uniform in +-p
%     others        p: the same for the measured x, x_dot and theta_dot, each with its own u
%     angle_offset  standard deviation of a normal number added to the measured angle [rad]
%
%   The published cases are 'none', 'actuator-5', 'actuator-10', 'sensor-5', 'sensor-10',
%   'gaussian-0.1' and 'gaussian-0.2' (variance in degrees^2). Further cases are 'all-5' and
%   'all-10'. Measurement noise affects only the learner: the cart-pole and the test for a fall
%   use the true state.
%
%   [~, names] = upright.noise_case() returns the names of the seven published cases.
%
%   Example:
%     noise = upright.noise_case('gaussian-0.2');
%     noise.angle_offset * 180 / pi                    % 0.447 degrees
%
%   See also upright.measure, upright.disturb.
    known = {'none', 'actuator-5', 'actuator-10', 'sensor-5', 'sensor-10', ...
        'gaussian-0.1', 'gaussian-0.2', 'all-5', 'all-10'};
    names = known(1:7);
    if nargin == 0
        name = 'none';
    end
    upright.internal.require_one_of('noise', name, known);
    noise = struct('actuator', 0, 'angle', 0, 'others', 0, 'angle_offset', 0);
    switch name
        case 'actuator-5'
            noise.actuator = 0.05;
        case 'actuator-10'
            noise.actuator = 0.10;
        case 'sensor-5'
            noise.angle = 0.05;
        case 'sensor-10'
            noise.angle = 0.10;
        case 'gaussian-0.1'
            noise.angle_offset = sqrt(0.1) * (pi / 180);
        case 'gaussian-0.2'
            noise.angle_offset = sqrt(0.2) * (pi / 180);
        case 'all-5'
            noise.angle = 0.05;
            noise.others = 0.05;
        case 'all-10'
            noise.angle = 0.10;
            noise.others = 0.10;
    end
end

%!test
%! [~, names] = upright.noise_case ();
%! assert (numel (names), 7);
%! for k = 1:7, noise = upright.noise_case (names{k}); end
%! assert ((noise.angle_offset * 180 / pi) ^ 2, 0.2, 1e-12);
%!error id=upright:badValue upright.noise_case ('gaussian-0.3')
%!error id=upright:badValue upright.noise_case (5)
