function interval = wilson_interval(successes, runs)
%WILSON_INTERVAL  The 95 % interval of a success rate (E. B. Wilson, 1927).
%
%   Example:
%     upright.internal.wilson_interval(20, 20)         % 0.84 1
    z = -sqrt(2) * erfcinv(1.95);                      % 1.96, of the normal distribution
    rate = successes / runs;
    middle = rate + z^2 / (2 * runs);
    half = z * sqrt(rate * (1 - rate) / runs + z^2 / (4 * runs^2));
    interval = (middle + [-half, half]) / (1 + z^2 / runs);
    interval = min(1, max(0, interval));
end

%!assert (upright.internal.wilson_interval (20, 20), [0.8388748, 1], 1e-6)
%!assert (upright.internal.wilson_interval (3, 10), [0.1077913, 0.6032219], 1e-6)
