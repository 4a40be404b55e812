function policy = table_policy(s, table)
%TABLE_POLICY  What Q-learning learned, as data: for each box the probability of a push right.
%   policy = upright.internal.table_policy(s, table), with the settings and the table of a run.
%   The parts of theta_dot vary fastest; on an edge counts the box below.
%
%   Example:
%     s = upright.settings('q-learning');
%     policy = upright.internal.table_policy(s, zeros(1, 480));
    places = upright.internal.table_places(s);
    right = table(places(:, 2)) > table(places(:, 1));
    boxes = upright.internal.make_boxes(s);
    policy = struct('form', 'table', 'edges', {boxes.edges}, ...
        'probabilities', reshape(double(right), 1, []));
end
