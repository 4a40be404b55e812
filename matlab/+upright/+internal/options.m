function chosen = options(defaults, pairs)
%OPTIONS  Options given as name and value, over their defaults.
%   chosen = upright.internal.options(defaults, pairs) returns the struct defaults with the values
%   in the cell array pairs, or stops with an error that names the unknown option.
%
%   Example:
%     upright.internal.options(struct('runs', 20), {'runs', 100})
    chosen = defaults;
    if mod(numel(pairs), 2) ~= 0
        error('upright:badOption', 'options come in pairs, a name and its value; %d were given', ...
            numel(pairs));
    end
    for k = 1:2:numel(pairs)
        if ~ischar(pairs{k}) || ~isfield(defaults, pairs{k})
            error('upright:badOption', 'option %s is unknown; it must be one of %s', ...
                upright.internal.shown(pairs{k}), strjoin(fieldnames(defaults)', ', '));
        end
        chosen.(pairs{k}) = pairs{k + 1};
    end
end

%!assert (upright.internal.options (struct ('a', 1, 'b', 2), {'b', 3}), struct ('a', 1, 'b', 3))
%!error <option 'c' is unknown; it must be one of a, b> upright.internal.options (struct ('a', 1, 'b', 2), {'c', 3})
%!error <in pairs> upright.internal.options (struct ('a', 1), {'a'})
