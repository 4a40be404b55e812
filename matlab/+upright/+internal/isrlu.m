function z = isrlu(z)
%ISRLU  A unit's output: z above zero, z / sqrt(1 + z^2) below, so that it bends towards -1.
%   It is ELU without an exponential (B. Carlile et al., 2017).
%
%   Example:
%     upright.internal.isrlu([-1 0 2])
    below = min(z, 0);
    z = z ./ sqrt(1 + below .* below);
end

%!assert (upright.internal.isrlu ([-1 0 2]), [-1 / sqrt(2), 0, 2], 1e-16)
