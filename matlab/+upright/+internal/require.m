function require(name, value, low, high, kind)
%REQUIRE  Stop with a clear error unless a value is a finite number from low to high.
%   upright.internal.require(name, value, low, high, kind), where kind is 'any' (the default),
%   'whole', or 'above' (low itself is refused).
%
%   Example:
%     upright.internal.require('learning_rate', 1.5, 0, 1)
    if nargin < 5
        kind = 'any';
    end
    allowed = (isnumeric(value) || islogical(value)) && isscalar(value) && isreal(value) ...
        && isfinite(value) && value >= low && value <= high ...
        && ~(strcmp(kind, 'above') && value == low) ...
        && ~(strcmp(kind, 'whole') && value ~= round(value));
    if ~allowed
        nouns = struct('any', 'a number', 'whole', 'a whole number', 'above', 'a number');
        relation = 'at least';
        if strcmp(kind, 'above')
            relation = 'above';
        end
        limit = '';
        if isfinite(high)
            limit = sprintf(' and at most %g', high);
        end
        error('upright:badValue', '%s is %s; it must be %s, %s %g%s', name, ...
            upright.internal.shown(value), nouns.(kind), relation, low, limit);
    end
end

%!test upright.internal.require ('x', 3, 1, 5, 'whole');
%!error <learning_rate is 1.5; it must be a number, at least 0 and at most 1> upright.internal.require ('learning_rate', 1.5, 0, 1)
%!error <it must be a whole number> upright.internal.require ('runs', 1.5, 1, 10, 'whole')
%!error <above 0> upright.internal.require ('scale', 0, 0, Inf, 'above')
%!error <is NaN> upright.internal.require ('scale', NaN, 0, Inf)
%!error <is 'x'> upright.internal.require ('scale', 'x', 0, Inf)
%!error <2x2 double> upright.internal.require ('scale', ones (2), 0, Inf)
