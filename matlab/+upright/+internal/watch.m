function go_on = watch(chosen, trial, step, state, force, fallen)
%WATCH  Tell whoever watches a run of a step; return whether the run goes on.
%
%   Example:
%     upright.internal.watch(struct('watch', []), 1, 1, [0 0 0 0], 10, false)    % 1
    go_on = true;
    if ~isempty(chosen.watch)
        go_on = chosen.watch(struct( ...
            'trial', trial, 'step', step, 'state', state, 'force', force, 'fallen', fallen));
    end
end
