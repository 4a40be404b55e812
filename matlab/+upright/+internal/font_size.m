function points = font_size(window, pixels)
%FONT_SIZE  The FontSize in points that shows letters of a size in pixels.
%   points = upright.internal.font_size(window, pixels)
%
%   MATLAB relates points to inches on the screen. In Octave, a point is one pixel with the toolkit
%   qt, and more than one pixel with gnuplot.
%
%   Example:
%     window = upright.internal.new_figure(false, 640, 400);
%     text(0.5, 0.5, 'balanced', 'FontSize', upright.internal.font_size(window, 14));
    if exist('OCTAVE_VERSION', 'builtin') == 0
        points = pixels * 72 / get(0, 'ScreenPixelsPerInch');
    elseif strcmp(graphics_toolkit(window), 'gnuplot')
        place = get(window, 'Position');
        points = 0.72 * pixels * 640 / place(3);       % it grows with the figure as well
    else
        points = pixels;
    end
end
