function width = stroke(window, finer)
%STROKE  The LineWidth, and MarkerSize, of about one pixel in a picture.
%   width = upright.internal.stroke(window, finer), where finer says how many times larger than
%   its picture the figure is drawn. With the toolkit gnuplot, lines stay thin in large figures.
%
%   Example:
%     window = upright.internal.new_figure(false, 640, 400);
%     line([0 1], [0 1], 'LineWidth', 2 * upright.internal.stroke(window, 1));
    width = finer;
    if exist('OCTAVE_VERSION', 'builtin') > 0 && strcmp(graphics_toolkit(window), 'gnuplot')
        width = 1 + 2 * (finer - 1);
    end
end
