function memory = policy_gradient(s, memory, episode)
%POLICY_GRADIENT  The update of REINFORCE after a fall.
%   memory = upright.internal.policy_gradient(s, memory, episode) learns from the last s.episodes
%   episodes, the new one among them: s.epochs steps of Adam (Kingma & Ba, 2015) up the gradient
%
%     mean over steps of  w_t A_t grad log pi(a_t | o_t)
%
%   A_t is the return less a baseline V, over its root mean square: 'fitted' V is a regression on
%   a constant and the products of two inputs, 'mean' V the mean return. w_t, at most 1, is how
%   much more likely the push is under the present policy than under the one that made it. A step
%   of Adam uses every s.stride-th row, in turn, and lets the weights decay a little.
%
%     s         from upright.settings('reinforce')
%     memory    from upright.internal.new_network, or from here
%     episode   from upright.internal.make_episode
%
%   Example: see upright.reinforce, which uses it.
    memory.newest = mod(memory.newest, s.episodes) + 1;
    memory.episodes{memory.newest} = episode;
    kept = [memory.episodes{:}];
    steps = struct('inputs', vertcat(kept.inputs), 'pushes', vertcat(kept.pushes), ...
        'probabilities', vertcat(kept.probabilities));
    returns = vertcat(kept.returns);

    if strcmp(s.baseline, 'fitted')
        memory = fit_baseline(memory, episode);
        coefficients = memory.moments \ memory.targets;
        advantages = returns - min(0, max(-1, features(steps.inputs) * coefficients));
    else
        advantages = returns - mean(returns);
    end
    steps.advantages = advantages / sqrt(max(mean(advantages .^ 2), 1e-12));

    rows = cell(1, numel(kept));
    for k = 1:numel(kept)
        rows{k} = (0:numel(kept(k).returns) - 1)';
    end
    turn = mod(vertcat(rows{:}), s.stride);
    for epoch = 0:s.epochs - 1
        gradient = gradient_over(s, memory.weights, steps, turn == mod(epoch, s.stride));
        memory = ascend(s, memory, gradient);
    end
end

function memory = fit_baseline(memory, episode)
    % Fit V to the newest episode's returns, and ever less to the ones before.
    found = features(episode.inputs);
    memory.moments = 0.9 * memory.moments + 1e-3 * eye(11) + found' * found;
    memory.targets = 0.9 * memory.targets + found' * episode.returns;
end

function found = features(inputs)
    [a, b] = find(tril(ones(4)));
    found = [ones(size(inputs, 1), 1), inputs(:, a) .* inputs(:, b)];
end

function gradient = gradient_over(s, weights, steps, rows)
    inputs = steps.inputs(rows, :);
    pushes = steps.pushes(rows);
    [right, hidden_1, hidden_2] = upright.internal.evaluate_network(weights, s.logit_scale, inputs);
    probability = right .* pushes + (1 - right) .* ~pushes;
    importance = min(1, probability ./ steps.probabilities(rows));
    weight = importance .* steps.advantages(rows) / numel(right);
    error_3 = weight .* (pushes - right) * s.logit_scale; % along the network's last sum

    error_2 = (error_3 * weights{3}') .* slope(hidden_2);
    error_1 = (error_2 * weights{2}') .* slope(hidden_1);
    gradient = {inputs' * error_1, hidden_1' * error_2, hidden_2' * error_3};
end

function d = slope(output)
    % The derivative of isrlu, from its output.
    below = min(output, 0);
    d = (1 - below .* below) .^ 1.5;
end

function memory = ascend(s, memory, gradient)
    adam = memory.adam;
    g = [gradient{1}(:); gradient{2}(:); gradient{3}(:)];
    adam.steps = adam.steps + 1;
    adam.mean = adam.mean + (1 - s.beta1) * (g - adam.mean);
    adam.mean_square = adam.mean_square + (1 - s.beta2) * (g .* g - adam.mean_square);
    mean_part = 1 - s.beta1 ^ adam.steps;
    square_part = 1 - s.beta2 ^ adam.steps;
    change = s.learning_rate * adam.mean / mean_part ...
        ./ (sqrt(adam.mean_square / square_part) + 1e-8);
    place = 0;
    for k = 1:3
        w = memory.weights{k};
        w(:) = (1 - s.weight_decay) * (w(:) + change(place + (1:numel(w))'));
        memory.weights{k} = w;
        place = place + numel(w);
    end
    memory.adam = adam;
end

%!test  # the gradient is that of the mean weighted log-probability, by finite differences
%! rand ('twister', 3);
%! s = upright.settings ('reinforce');
%! s.epochs = 1; s.stride = 1; s.weight_decay = 0; s.beta1 = 0; s.baseline = 'mean';
%! memory = upright.internal.new_network (s, rand (1, 176));
%! inputs = randn (40, 4); pushes = rand (40, 1) < 0.5;
%! right = upright.internal.evaluate_network (memory.weights, s.logit_scale, inputs);
%! then = right .* pushes + (1 - right) .* ! pushes;
%! padded = @(a) [a; zeros(1000 - 40, columns (a))];
%! episode = upright.internal.make_episode (s, 40, padded (inputs), padded (pushes) > 0, padded (then));
%! after = upright.internal.policy_gradient (s, memory, episode);
%! g = after.adam.mean;                                # beta1 0: the gradient itself
%! a = episode.returns - mean (episode.returns);
%! a /= sqrt (mean (a .^ 2));
%! for k = [1 20 33 100 160 170]
%!   layer = 1 + (k > 32) + (k > 160); at = k - [0 32 160](layer);
%!   h = 1e-6; value = [0 0];
%!   for side = 1:2
%!     w = memory.weights; w{layer}(at) += h * (2 * side - 3);
%!     q = upright.internal.evaluate_network (w, s.logit_scale, inputs);
%!     value(side) = mean (a .* log (q .* pushes + (1 - q) .* ! pushes));
%!   end
%!   # importance weights are 1 at the policy that made the pushes, and are not differentiated
%!   assert (g(k), diff (value) / (2 * h), 1e-6);
%! end
