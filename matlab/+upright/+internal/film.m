function [take, finish] = film(window, file, seconds, finer)
%FILM  Pictures of a figure, one after the other, into a file.
%   [take, finish] = upright.internal.film(window, file, seconds, finer) returns two functions:
%   take() adds a picture as the figure is now, finish() ends the film and writes what is left.
%
%     file      'name.gif'       an animation, each picture shown for that many seconds; the last
%                                for two, and then it begins again
%               'name%05d.png'   a file for each picture, numbered from 1
%               'name.png'       the last picture alone
%     finer     how many times larger than its picture the figure is drawn
%
%   Each file is whole or not there.
%
%   Example:
%     window = upright.internal.new_figure(false, 1280, 800);
%     [take, finish] = upright.internal.film(window, 'film.gif', 0.04, 2);
%     take();
%     finish();
%
%   See also upright.animate.
    count = 0;
    frames = zeros(0, 0, 1, 0, 'uint8');
    [~, ~, ending] = fileparts(file);
    if strcmp(ending, '.gif')
        [map, nearest] = palette();
        take = @add;
        finish = @write_animation;
    elseif any(file == '%')
        take = @write_next;
        finish = @nothing;
    else
        take = @nothing;
        finish = @write_last;
    end

    function add()
        pixels = floor(double(upright.internal.picture_of(window, finer)) / 8);
        count = count + 1;
        if count > size(frames, 4)
            frames(size(pixels, 1), size(pixels, 2), 1, 2 * count) = 0;    % room for as many again
        end
        frames(:, :, 1, count) = nearest(1 + pixels(:, :, 1) + 32 * pixels(:, :, 2) ...
            + 1024 * pixels(:, :, 3));
    end

    function write_animation()
        frames = frames(:, :, :, 1:count);
        upright.internal.write_whole(file, @write_gif);
    end

    function write_gif(part)
        delays = [seconds * ones(1, count - 1), 2];
        if exist('OCTAVE_VERSION', 'builtin') > 0
            % All at once: to append a picture, Octave reads all the others again. In true colour,
            % too: of many pictures with a map, Octave 7 writes the first again and again.
            imwrite(in_true_colour(frames, map), part, 'DelayTime', delays, 'LoopCount', Inf, ...
                'Compression', 'lzw');
            return
        end
        imwrite(frames(:, :, 1, 1), map, part, 'DelayTime', delays(1), 'LoopCount', Inf);
        for k = 2:count
            imwrite(frames(:, :, 1, k), map, part, 'DelayTime', delays(k), 'WriteMode', 'append');
        end
    end

    function write_next()
        count = count + 1;
        upright.internal.write_whole(sprintf(file, count), @write_png);
    end

    function write_last()
        upright.internal.write_whole(file, @write_png);
    end

    function write_png(part)
        imwrite(upright.internal.picture_of(window, finer), part);
    end

    function nothing()
    end
end

function pixels = in_true_colour(frames, map)
    [height, width, ~, count] = size(frames);
    bytes = uint8(255 * map);
    pixels = zeros(height, width, 3, count, 'uint8');
    for k = 1:count
        pixels(:, :, :, k) = reshape(bytes(1 + double(frames(:, :, 1, k)), :), [height, width, 3]);
    end
end

function [map, nearest] = palette()
    % The colours that are drawn, and what smooth edges make of two. nearest has the place in the
    % map, from 0, for each colour in 32 parts of red, of green and of blue.
    pure = struct2cell(upright.internal.colours());
    pure = unique(vertcat(pure{:}), 'rows');
    map = zeros(0, 3);
    for i = 1:size(pure, 1)
        for j = 1:i
            map = [map; (0:0.25:1)' * pure(i, :) + (1:-0.25:0)' * pure(j, :)]; %#ok<AGROW>
        end
    end
    map = unique(round(map * 255), 'rows');
    map = map(1:min(end, 256), :) / 255;
    [red, green, blue] = ndgrid((0:31) / 31);
    nearest = zeros(32 ^ 3, 1, 'uint8');
    least = Inf(32 ^ 3, 1);
    for k = 1:size(map, 1)
        distance = (red(:) - map(k, 1)) .^ 2 + (green(:) - map(k, 2)) .^ 2 ...
            + (blue(:) - map(k, 3)) .^ 2;
        closer = distance < least;
        nearest(closer) = k - 1;
        least(closer) = distance(closer);
    end
end
