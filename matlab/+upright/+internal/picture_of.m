function pixels = picture_of(window, finer)
%PICTURE_OF  The pixels of a figure: height-by-width-by-3, uint8.
%   pixels = upright.internal.picture_of(window, finer) takes a figure drawn so many times larger
%   than its picture, which smooths all edges. It need not be visible.
%
%   Example:
%     window = upright.internal.new_figure(false, 1280, 800);
%     image(upright.internal.picture_of(window, 2));   % 400-by-640-by-3
%
%   See also upright.internal.new_figure, upright.internal.film.
    if exist('OCTAVE_VERSION', 'builtin') > 0 && strcmp(graphics_toolkit(window), 'gnuplot')
        large = printed(window);
    else
        drawnow();
        frame = getframe(window);
        large = frame.cdata;
    end
    height = floor(size(large, 1) / finer);
    width = floor(size(large, 2) / finer);
    total = zeros(height, width, 3);
    for row = 1:finer
        for column = 1:finer
            total = total + double(large(row:finer:finer * height, column:finer:finer * width, :));
        end
    end
    pixels = uint8(total / finer ^ 2);
end

function pixels = printed(window)
    file = [tempname() '.png'];
    tidy = onCleanup(@() delete(file));
    place = get(window, 'Position');
    print(window, '-dpng', sprintf('-S%d,%d', place(3), place(4)), file);
    [pixels, map] = imread(file);
    if ~isempty(map)
        pixels = ind2rgb(pixels, map);
    end
    if ~isa(pixels, 'uint8')                           % pure colours are read as logical
        pixels = uint8(255 * double(pixels));
    end
    if size(pixels, 3) == 1
        pixels = repmat(pixels, [1 1 3]);
    end
end

%!test
%! window = upright.internal.new_figure (false, 320, 200);
%! unwind_protect
%!   room = axes ('parent', window, 'position', [0 0 1 1], 'visible', 'off', 'xlim', [0 1], 'ylim', [0 1]);
%!   patch ('parent', room, 'faces', 1:4, 'vertices', [0 0; 0.5 0; 0.5 1; 0 1], 'facecolor', [1 0 0], 'edgecolor', 'none');
%!   pixels = upright.internal.picture_of (window, 2);
%!   assert (size (pixels), [100 160 3]);
%!   assert (class (pixels), 'uint8');
%!   assert (squeeze (pixels(50, 40, :))', uint8 ([255 0 0]));
%!   assert (squeeze (pixels(50, 120, :))', uint8 ([255 255 255]));
%! unwind_protect_cleanup
%!   delete (window);
%! end_unwind_protect
