function box = find_box(boxes, observation)
%FIND_BOX  The number of the box that a measurement lies in; on an edge, of the one below.
%   box = upright.internal.find_box(boxes, observation) returns n-by-1 numbers, from 1; the parts
%   of theta_dot vary fastest.
%
%     boxes         from upright.internal.make_boxes
%     observation   n-by-4: x [m], x_dot [m/s], theta [rad], theta_dot [rad/s]
%
%   Example:
%     boxes = upright.internal.make_boxes(upright.settings('q-learning'));
%     upright.internal.find_box(boxes, [0 0 0.1 -0.1])
    % Each edge that lies below the measurement leads one part up.
    box = 1 + (observation(:, boxes.column) > boxes.edge) * boxes.stride;
end

%!test
%! s = struct ('x_edges', [-1 1], 'x_dot_edges', [], 'theta_edges', 0, 'theta_dot_edges', 0);
%! boxes = upright.internal.make_boxes (s);
%! assert (boxes.count, 12);
%! seen = [0 0 0.1 -0.1; -1 9 0 0; 2 0 1 1; 0 0 0 1];
%! assert (upright.internal.find_box (boxes, seen), [7; 1; 12; 6]);
%!test  # no edges, one box
%! s = struct ('x_edges', [], 'x_dot_edges', [], 'theta_edges', [], 'theta_dot_edges', []);
%! boxes = upright.internal.make_boxes (s);
%! assert (upright.internal.find_box (boxes, ones (3, 4)), [1; 1; 1]);
