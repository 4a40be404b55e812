function [right, history] = push_probability(policy, observation, history)
%PUSH_PROBABILITY  The probability with which a learned policy pushes to the right.
%   right = upright.push_probability(policy, observation) returns n-by-1 numbers from 0 to 1.
%
%     policy        a learned policy (result.policy), or one from upright.import_policy
%     observation   n-by-4 measurements: x [m], x_dot [m/s], theta [rad], theta_dot [rad/s]
%
%   [right, history] = upright.push_probability(policy, observation, history) is for policies that
%   use past measurements (policy.past steps): history is [] when a trial begins, then the history
%   returned by the previous call. Such a policy is deterministic, and its push is assumed to be
%   applied.
%
%   Example:
%     result = upright.q_learning('steps', 1000);
%     upright.push_probability(result.policy, [0 0 0.05 0])
%
%   See also upright.simulate, upright.import_policy, upright.export_policy.
    if nargin < 3
        history = [];
    end
    if size(observation, 2) ~= 4
        upright.internal.refuse_state('observation', observation);
    end
    if strcmp(policy.form, 'table')
        names = {'x_edges', 'x_dot_edges', 'theta_edges', 'theta_dot_edges'};
        boxes = upright.internal.make_boxes(cell2struct(policy.edges(:), names, 1));
        right = reshape(policy.probabilities, [], 1);
        right = right(upright.internal.find_box(boxes, observation));
        return
    end
    values = observation;
    if ~isempty(policy.scales)
        values = values ./ reshape(policy.scales, 1, 4);
    end
    if policy.past > 0
        if isempty(history)
            history = repmat([zeros(size(observation, 1), 1), observation], 1, policy.past);
        end
        values = [values, history];
    end
    for layer = reshape(policy.layers, 1, [])
        values = unit_output(layer.unit, values * layer.weights);
    end
    right = values;
    if policy.past > 0
        history = [2 * right - 1, observation, history(:, 1:end - 5)];
    end
end

function z = unit_output(unit, z)
    switch unit
        case 'isrlu'
            z = upright.internal.isrlu(z);
        case 'tanh'
            z = tanh(z);
        case 'sigmoid'
            z = 1 ./ (1 + exp(-z));
        case 'above zero'
            z = double(z > 0);
        case 'not below zero'
            z = double(z >= 0);
        otherwise
            error('upright:badPolicy', 'unit is ''%s''; it must be one of %s', unit, ...
                'isrlu, tanh, sigmoid, above zero, not below zero');
    end
end

%!test
%! policy = upright.internal.network_policy ({[0; 0; 1; 0]}, {'sigmoid'}, [1 1 0.5 1]);
%! assert (upright.push_probability (policy, [1 1 0 1; 0 0 1 0]), [0.5; 1 / (1 + exp(-2))], 1e-15);
%!test
%! policy = struct ('form', 'table', 'edges', {{[], [], 0, 0}}, 'probabilities', [0 0.25 0.5 1]);
%! seen = [0 0 -1 -1; 0 0 -1 1; 0 0 1 0; 0 0 1 1];
%! assert (upright.push_probability (policy, seen), [0; 0.25; 0.5; 1]);
%!test  # one that looks back one step: it pushes to where the pole moved
%! policy = upright.internal.network_policy ({[0; 0; 1; 0; 0; 0; 0; -1; 0]}, {'above zero'}, []);
%! policy.past = 1;
%! [right, history] = upright.push_probability (policy, [0 0 0.1 0]);
%! assert (right, 0);
%! [right, history] = upright.push_probability (policy, [0 0 0.2 0], history);
%! assert (right, 1);
%! assert (history, [1 0 0 0.2 0]);
