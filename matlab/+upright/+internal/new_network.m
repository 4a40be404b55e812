function memory = new_network(s, uniform)
%NEW_NETWORK  What REINFORCE knows before its first trial: random weights, no episodes.
%   memory = upright.internal.new_network(s, uniform) takes the settings and 176 numbers, uniform
%   from 0 to 1, and returns a struct: the weights of the three layers (4-by-8, 8-by-16, 16-by-1),
%   the last episodes, the baseline's regression, and Adam's averages.
%
%   Example:
%     memory = upright.internal.new_network(upright.settings('reinforce'), rand(1, 176));
%
%   See also upright.internal.policy_gradient.
    inputs = [4 * ones(1, 32), 8 * ones(1, 128), 16 * ones(1, 16)];
    row = s.init_std * sqrt(3 ./ inputs) .* (2 * uniform - 1);
    weights = {reshape(row(1:32), 8, 4)', reshape(row(33:160), 16, 8)', row(161:176)'};
    features = 11;
    memory = struct( ...
        'weights', {weights}, ...
        'episodes', {cell(1, s.episodes)}, ...
        'newest', 0, ...
        'moments', zeros(features), ...
        'targets', zeros(features, 1), ...
        'adam', struct('steps', 0, 'mean', zeros(176, 1), 'mean_square', zeros(176, 1)));
end
