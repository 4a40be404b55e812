function properties = steps_axis()
%STEPS_AXIS  Properties of axes whose vertical one counts steps, in powers of ten.
%   properties = upright.internal.steps_axis() returns names and values in a cell.
%
%   Example:
%     properties = upright.internal.steps_axis();
%     axes(properties{:});
    properties = {'YScale', 'log', 'YMinorTick', 'off', 'YTick', 10 .^ (0:9), 'YTickLabel', ...
        {'1', '10', '100', '1000', '10^4', '10^5', '10^6', '10^7', '10^8', '10^9'}};
end
