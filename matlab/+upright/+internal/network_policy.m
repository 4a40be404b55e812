function policy = network_policy(weights, units, scales)
%NETWORK_POLICY  A learned network as data, as upright.push_probability takes it.
%   policy = upright.internal.network_policy(weights, units, scales)
%
%     weights   cell: of each layer a matrix, inputs-by-units
%     units     cell: of each layer 'isrlu', 'tanh', 'sigmoid', 'above zero' or 'not below zero'
%     scales    1-by-4: what each measurement is divided by first; [] if they are not
%
%   Example: push to where the pole leans
%     policy = upright.internal.network_policy({[0; 0; 1; 0]}, {'above zero'}, []);
    policy = struct('form', 'network', ...
        'layers', struct('unit', units, 'weights', weights), ...
        'scales', scales, 'past', 0);
end
