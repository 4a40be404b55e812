function policy = reinforce_policy(s, weights)
%REINFORCE_POLICY  What REINFORCE learned, as data; the logit scale goes into the last weights.
%
%   Example:
%     s = upright.settings('reinforce');
%     memory = upright.internal.new_network(s, rand(1, 176));
%     policy = upright.internal.reinforce_policy(s, memory.weights);
    weights{3} = s.logit_scale * weights{3};
    policy = upright.internal.network_policy(weights, {'isrlu', 'isrlu', 'sigmoid'}, ...
        upright.internal.scales_of(s));
end
