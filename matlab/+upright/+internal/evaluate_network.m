function [probability, hidden_1, hidden_2] = evaluate_network(weights, scale, inputs)
%EVALUATE_NETWORK  The probability of a push to the right, by REINFORCE's network.
%   [probability, hidden_1, hidden_2] = upright.internal.evaluate_network(weights, scale, inputs)
%   returns n-by-1 probabilities for n-by-4 inputs, and what the hidden units put out, n-by-8 and
%   n-by-16.
%
%   Example:
%     memory = upright.internal.new_network(upright.settings('reinforce'), rand(1, 176));
%     upright.internal.evaluate_network(memory.weights, 3, [0 0 0.1 0])
    hidden_1 = upright.internal.isrlu(inputs * weights{1});
    hidden_2 = upright.internal.isrlu(hidden_1 * weights{2});
    probability = 1 ./ (1 + exp(-scale * (hidden_2 * weights{3})));
end
