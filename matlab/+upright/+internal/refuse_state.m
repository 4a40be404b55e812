function refuse_state(name, value)
%REFUSE_STATE  Stop, as this is no n-by-4 array of states or measurements.
%
%   Example:
%     upright.internal.refuse_state('state', [0 0 0])
    error('upright:badState', ...
        '%s is %s of size %s; it must be numbers of size n-by-4: x, x_dot, theta, theta_dot', ...
        name, class(value), mat2str(size(value)));
end

%!error <state is double of size .1 3.; it must be numbers of size n-by-4> upright.internal.refuse_state ('state', [0 0 0])
