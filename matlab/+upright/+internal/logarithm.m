function y = logarithm(x)
%LOGARITHM  Natural logarithm of positive numbers, to a relative 1e-15; the same bits everywhere.
%   x = m 2^e with m from sqrt(1/2) to sqrt(2); log m = 2 artanh s by its series, where
%   s = (m - 1) / (m + 1). As upright/core/portable_math.py.
%
%   Example:
%     upright.internal.logarithm(0.5)
    [m, exponent] = log2(x);
    low = m < sqrt(0.5);
    m(low) = 2 * m(low);
    exponent(low) = exponent(low) - 1;
    s = (m - 1) ./ (m + 1);
    z = s .* s;
    z2 = z .* z;
    z4 = z2 .* z2;
    series = (1 / 3 + z * (1 / 5)) + z2 .* (1 / 7 + z * (1 / 9));
    series = series + z4 .* ((1 / 11 + z * (1 / 13)) ...
        + z2 .* (1 / 15 + z * (1 / 17)) + z4 * (1 / 19));
    y = exponent * log(2) + 2 * s .* (1 + z .* series);
end

%!test
%! x = [linspace(1e-6, 3, 10001)'; 2 .^ (-53:0)'];
%! assert (upright.internal.logarithm (x), log (x), -2e-15);
