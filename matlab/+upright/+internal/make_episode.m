function episode = make_episode(s, steps, inputs, pushes, probabilities)
%MAKE_EPISODE  What REINFORCE keeps of a trial that ended by a fall.
%   episode = upright.internal.make_episode(s, steps, inputs, pushes, probabilities)
%
%     s               settings
%     steps           how many steps the trial lasted
%     inputs, ...     rings of s.kept_steps rows: step t, from 0, stands in row 1 + mod(t, rows)
%
%   The episode has as many rows as steps were kept, and for each the return -gamma^k, where k is
%   the number of steps from it to the last.
%
%   Example:
%     s = upright.settings('reinforce');
%     episode = upright.internal.make_episode(s, 2, zeros(1000, 4), true(1000, 1), ones(1000, 1));
    kept = min(steps, s.kept_steps);
    before_last = mod(steps - 1 - (0:kept - 1)', kept);
    episode = struct( ...
        'inputs', inputs(1:kept, :), ...
        'pushes', pushes(1:kept), ...
        'probabilities', probabilities(1:kept), ...
        'returns', -s.discount .^ before_last);
end

%!test
%! s = upright.settings ('reinforce');
%! s.kept_steps = 3;
%! s.discount = 0.5;
%! ring = [3; 4; 2];                                   # steps 3, 4 and 2 of 0 to 4
%! episode = upright.internal.make_episode (s, 5, [ring ring ring ring], true (3, 1), ring);
%! assert (episode.returns, [-0.5; -1; -0.25]);
