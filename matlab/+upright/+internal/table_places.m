function places = table_places(s)
%TABLE_PLACES  Where a table has the value of each box and push.
%   places = upright.internal.table_places(s) returns boxes-by-2 places, push left and push right,
%   for the settings of Q-learning. Mirrored, a box and its mirror image share theirs, pushes
%   exchanged.
%
%   Example:
%     places = upright.internal.table_places(upright.settings('q-learning'));
    boxes = upright.internal.make_boxes(s);
    places = reshape(1:2 * boxes.count, 2, boxes.count)';
    if s.mirrored
        places = min(places, 2 * boxes.count + 1 - places);
    end
end

%!test
%! s = struct ('x_edges', [], 'x_dot_edges', [], 'theta_edges', 0, 'theta_dot_edges', [], 'mirrored', false);
%! assert (upright.internal.table_places (s), [1 2; 3 4]);
%! s.mirrored = true;
%! assert (upright.internal.table_places (s), [1 2; 2 1]);
