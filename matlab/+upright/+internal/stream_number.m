function number = stream_number(seed, run)
%STREAM_NUMBER  Which stream of random numbers is a run's own.
%   number = upright.internal.stream_number(seed, run) returns 1e6 * seed + run, so that run 1 of
%   seed 0 draws what rand gives after rng(1). Runs are counted from 1, up to a million.
%
%   Example:
%     upright.internal.stream_number(0, 1)             % 1
%
%   See also upright.internal.random_streams.
    upright.internal.require('seed', seed, 0, 4293, 'whole');
    for each = reshape(run, 1, [])
        upright.internal.require('run', each, 1, 1e6, 'whole');
    end
    number = 1e6 * seed + run;
end

%!assert (upright.internal.stream_number (2, [1 5]), [2000001 2000005])
%!error <seed is -1> upright.internal.stream_number (-1, 1)
%!error <run is 0> upright.internal.stream_number (0, 0)
