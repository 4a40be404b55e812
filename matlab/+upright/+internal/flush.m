function flush()
%FLUSH  Flush the output, which Octave buffers if it is not a terminal.
%
%   Example:
%     fprintf('a line\n'); upright.internal.flush();
    if exist('OCTAVE_VERSION', 'builtin') > 0
        fflush(stdout());
    end
end
