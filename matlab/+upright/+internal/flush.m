function flush()
%FLUSH  Show what was printed now: Octave keeps it back where its output is no terminal.
%
%   Example:
%     fprintf('a line\n'); upright.internal.flush();
    if exist('OCTAVE_VERSION', 'builtin') > 0
        fflush(stdout());
    end
end
