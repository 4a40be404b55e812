function go_on = watch(chosen, trial, step, state, force, fallen)
%WATCH  Pass a step of a run to its 'watch' function; return whether the run continues.
%
%   Example:
%     upright.internal.watch(struct('watch', []), 1, 1, [0 0 0 0], 10, false)    % 1
    go_on = true;
    if ~isempty(chosen.watch)
        go_on = chosen.watch(struct( ...
            'trial', trial, 'step', step, 'state', state, 'force', force, 'fallen', fallen));
    end
end
