function interval = bootstrap_interval(values)
%BOOTSTRAP_INTERVAL  The 95 % interval of a mean: bias-corrected and accelerated (B. Efron, 1987).
%   The same values give the same interval, because the 9,999 resamples are drawn from a separate
%   stream. If all values are equal, the interval collapses to that value.
%
%   Example:
%     upright.internal.bootstrap_interval([5 9 12 30 7])
    n = numel(values);
    values = reshape(values, 1, n);
    if all(values == values(1))
        interval = [values(1), values(1)];
        return
    end
    resamples = 9999;
    draw = upright.internal.random_streams(1);
    means = zeros(1, resamples);
    for k = 1:resamples
        means(k) = mean(values(1 + floor(n * draw(1, n))));
    end
    below = (sum(means < mean(values)) + sum(means <= mean(values))) / (2 * resamples);
    bias = normal_quantile(below);
    apart = mean(values) - (sum(values) - values) / (n - 1);
    acceleration = sum(apart .^ 3) / (6 * sum(apart .^ 2) ^ 1.5);
    shifted = bias + normal_quantile([0.025, 0.975]);
    levels = 0.5 * erfc(-(bias + shifted ./ (1 - acceleration * shifted)) / sqrt(2));
    interval = interp1(0:resamples - 1, sort(means), levels * (resamples - 1));
end

function z = normal_quantile(p)
    z = -sqrt(2) * erfcinv(2 * p);
end

%!test  # what SciPy's BCa bootstrap gives, but for chance
%! interval = upright.internal.bootstrap_interval ([5 9 12 30 7 8 8 15 21 6]);
%! assert (interval, [8.9, 18.4], 0.5);
%!assert (upright.internal.bootstrap_interval ([3 3 3]), [3 3])
