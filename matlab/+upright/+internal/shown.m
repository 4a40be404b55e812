function text = shown(value)
%SHOWN  How an error names a value.
%
%   Example:
%     upright.internal.shown('zero')                   % 'zero', with its quotes
    if ischar(value)
        text = sprintf('''%s''', value);
    elseif (isnumeric(value) || islogical(value)) && isscalar(value)
        text = sprintf('%g', value);
    else
        text = sprintf('%dx%d %s', size(value, 1), size(value, 2), class(value));
    end
end

%!assert (upright.internal.shown ('a'), '''a''')
%!assert (upright.internal.shown (0.5), '0.5')
%!assert (upright.internal.shown ({1, 2}), '1x2 cell')
