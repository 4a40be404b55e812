function boxes = make_boxes(s)
%MAKE_BOXES  How the measurements are cut into boxes, from the settings of Q-learning.
%   boxes = upright.internal.make_boxes(s) returns what upright.internal.find_box takes: for each
%   edge which measurement it cuts, where [m, m/s, rad, rad/s], and how much further up lies the
%   number of the box beyond it.
%
%   Example:
%     boxes = upright.internal.make_boxes(upright.settings('q-learning'));
    edges = {s.x_edges, s.x_dot_edges, s.theta_edges, s.theta_dot_edges};
    counts = cellfun(@numel, edges);
    strides = fliplr(cumprod([1, fliplr(counts(2:4) + 1)]));
    column = zeros(1, 0);
    stride = zeros(0, 1);
    for k = 1:4
        column = [column, k * ones(1, counts(k))]; %#ok<AGROW>
        stride = [stride; strides(k) * ones(counts(k), 1)]; %#ok<AGROW>
    end
    boxes = struct('edges', {edges}, 'count', prod(counts + 1), 'column', column, ...
        'edge', reshape([edges{:}], 1, []), 'stride', stride);
end
