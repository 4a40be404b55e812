function text = to_json(value)
%TO_JSON  A value as JSON, numbers with all their digits; jsonencode leaves some out.
%   Structs become objects; cells, and rows of numbers, lists; [] a list of nothing.
%
%   Example:
%     upright.internal.to_json(struct('a', 0.1, 'b', {{1, 'x'}}))
    if ischar(value)
        value = strrep(strrep(value, '\', '\\'), '"', '\"');
        text = ['"' value '"'];
    elseif islogical(value) && isscalar(value)
        names = {'false', 'true'};
        text = names{value + 1};
    elseif isnumeric(value) && isscalar(value)
        text = sprintf('%.17g', value);
    elseif isstruct(value)
        names = fieldnames(value)';
        parts = cellfun(@(name) ['"' name '": ' upright.internal.to_json(value.(name))], names, ...
            'UniformOutput', false);
        text = ['{' strjoin(parts, ', ') '}'];
    else
        if ~iscell(value)
            value = num2cell(value);
        end
        parts = cellfun(@upright.internal.to_json, value, 'UniformOutput', false);
        text = ['[' strjoin(reshape(parts, 1, []), ', ') ']'];
    end
end

%!assert (upright.internal.to_json (struct ('a', 0.1, 'b', {{1, 'x"y', []}})), '{"a": 0.10000000000000001, "b": [1, "x\"y", []]}')
%!assert (upright.internal.to_json ([1 60000]), '[1, 60000]')
%!assert (upright.internal.to_json ({true, false}), '[true, false]')
