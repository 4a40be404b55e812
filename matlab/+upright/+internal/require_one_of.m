function require_one_of(name, value, allowed)
%REQUIRE_ONE_OF  Stop with a clear error unless a value is one of the allowed names.
%
%   Example:
%     upright.internal.require_one_of('noise', 'nothing', {'none', 'sensor-5'})
    if ~ischar(value) || ~any(strcmp(value, allowed))
        error('upright:badValue', '%s is %s; it must be one of %s', ...
            name, upright.internal.shown(value), strjoin(allowed, ', '));
    end
end

%!error <noise is 'nothing'; it must be one of none, sensor-5> upright.internal.require_one_of ('noise', 'nothing', {'none', 'sensor-5'})
%!error <noise is 3; it must be one of> upright.internal.require_one_of ('noise', 3, {'none'})
