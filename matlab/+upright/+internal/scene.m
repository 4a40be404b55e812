function draw = scene(window, p, about, steps, finer)
%SCENE  The picture of a cart-pole that learns: draws it once, then moves what moves.
%   draw = upright.internal.scene(window, p, about, steps, finer) returns a function:
%   draw(moment, lengths, note) shows a moment, as learners pass it to 'watch' functions.
%
%     window    figure, 640 by 400 pixels, or finer times as large
%     p         parameters, from upright.parameters
%     about     which learner this is, a line of text
%     steps     a trial of this many steps succeeds
%     finer     how many times larger letters and lines are drawn
%     lengths   steps of each trial that has ended
%     note      further text, such as the speed
%
%   Example:
%     window = upright.internal.new_figure(true, 640, 400);
%     draw = upright.internal.scene(window, upright.parameters(), 'q-learning', 500, 1);
%     moment = struct('trial', 3, 'step', 1, 'state', [0.5 0 0.1 0], 'force', 10, 'fallen', false);
%     draw(moment, [9 14], '');
%
%   See also upright.animate.
    CART = [-0.29 0.29 0.13 0.36];                     % left, right, bottom, top [m]
    HINGE = [0, 0.31];                                 % above the cart's middle [m]
    PUSH = 0.5;                                        % length of the usual push's arrow [m]
    GAP = 0.34;                                        % from the cart's middle to the arrow [m]
    c = upright.internal.colours();
    world = make_world(window, p, finer);

    angles = linspace(-p.angle_limit, p.angle_limit, 13)';
    allowed_shape = [0 0; 2 * p.half_length * [sin(angles), cos(angles)]];
    pole_shape = rod(2 * p.half_length, 0.04);
    cart_shape = rounded(CART, 0.06);
    wheel_shape = disc(0.075);
    dot_shape = disc(0.022);
    ring_shape = disc(0.055);
    arrow_shape = [0 -0.03; 0.7 -0.03; 0.7 -0.09; 1 0; 0.7 0.09; 0.7 0.03; 0 0.03];

    % What is drawn later covers what was drawn before.
    allowed = shape(world, allowed_shape, c.allowed);
    arrow = shape(world, arrow_shape, c.force);
    wheels = [shape(world, wheel_shape, c.ink), shape(world, wheel_shape, c.ink)];
    hubs = [shape(world, dot_shape, c.paper), shape(world, dot_shape, c.paper)];
    cart = shape(world, cart_shape, c.cart);
    pole = shape(world, pole_shape, c.pole);
    ring = shape(world, ring_shape, c.ink);
    pin = shape(world, dot_shape, c.paper);
    headline = write(world, [-2.7, 1.74], '', 16 * finer, 'left');
    set(headline, 'FontWeight', 'bold');
    second = write(world, [-2.7, 1.52], '', 13 * finer, 'left');
    set(second, 'Color', c.grey);
    curve = make_curve(window, steps, finer);
    draw = @update;

    function update(moment, lengths, note)
        move_cart(moment.state(1), moment.state(3), moment.force / p.force);
        ended = moment.fallen || moment.step >= steps;
        fate = '';
        colour = c.pole;
        if moment.fallen
            fate = 'fallen';
            colour = c.limit;
        elseif ended
            fate = 'balanced';
            colour = c.good;
        end
        set(pole, 'FaceColor', colour);
        set(headline, 'String', sprintf('trial %d    step %d    %.2f s    %s', ...
            moment.trial, moment.step, moment.step * p.time_step, fate));
        told = about;
        if ~isempty(lengths)
            told = sprintf('%s    longest: %d steps', about, max(lengths));
        end
        set(second, 'String', [told, note]);
        update_curve(curve, moment, lengths);
    end

    function move_cart(x, theta, push)
        at = [x, 0];
        rotation = [cos(theta), -sin(theta); sin(theta), cos(theta)];
        place(allowed, allowed_shape, at + HINGE);
        place(pole, pole_shape * rotation, at + HINGE);
        place(ring, ring_shape, at + HINGE);
        place(pin, dot_shape, at + HINGE);
        place(cart, cart_shape, at);
        for which = 1:2
            hub = at + [0.34 * which - 0.51, 0.075];
            place(wheels(which), wheel_shape, hub);
            place(hubs(which), dot_shape, hub);
        end
        place(arrow, arrow_shape .* [PUSH * push, 1], at + [GAP * sign(push), 0.245]);
    end
end

function world = make_world(window, p, finer)
    % One metre is as long in both directions in a figure of 640 by 400.
    c = upright.internal.colours();
    world = axes('Parent', window, 'Units', 'normalized', 'Position', [0 0.36 1 0.64], ...
        'XLim', [-2.86 2.86], 'YLim', [-0.4 1.888], 'Visible', 'off');
    limit = p.position_limit;
    shape(world, bar(-3, 3, -0.035, 0), c.faint);
    shape(world, bar(-limit, limit, -0.035, 0), c.ink);
    for side = [-limit, limit]
        shape(world, bar(side - 0.022, side + 0.022, -0.035, 0.14), c.limit);
    end
    for metre = -2:2
        shape(world, bar(metre - 0.007, metre + 0.007, -0.13, -0.08), c.ink);
        unit = '';
        if metre == 0
            unit = ' m';
        end
        write(world, [metre, -0.24], sprintf('%d%s', metre, unit), 13 * finer, 'center');
    end
end

function curve = make_curve(window, steps, finer)
    % The steps of each trial, the longest, and the trial that runs.
    c = upright.internal.colours();
    points = upright.internal.font_size(window, 12 * finer);
    stroke = upright.internal.stroke(window, finer);
    scale = upright.internal.steps_axis();
    room = axes('Parent', window, 'Units', 'normalized', 'Position', [0.115 0.12 0.845 0.215], ...
        scale{:}, 'YLim', [1, 1.8 * steps], ...
        'Color', c.paper, 'XColor', c.ink, 'YColor', c.ink, 'Box', 'off', ...
        'FontSize', points, 'LineWidth', 0.6 * stroke, 'TickLength', [0.006 0.006]);
    goal = line('Parent', room, 'XData', [0 1], 'YData', [steps steps], 'Color', c.good, ...
        'LineStyle', '--', 'LineWidth', stroke);
    curve = struct('room', room, 'goal', goal, 'ended', dots(room, c.cart, 3.5 * stroke), ...
        'longest', dots(room, c.good, 5 * stroke), 'running', dots(room, c.pole, 5 * stroke));
    set(curve.ended, 'LineStyle', '-', 'LineWidth', 1.2 * stroke);
    xlabel(room, 'trial', 'FontSize', points, 'Color', c.ink);
    ylabel(room, 'steps', 'FontSize', points, 'Color', c.ink);
end

function handle = dots(room, colour, points)
    handle = line('Parent', room, 'XData', NaN, 'YData', NaN, 'Color', colour, ...
        'LineStyle', 'none', 'Marker', 'o', 'MarkerFaceColor', colour, ...
        'MarkerEdgeColor', colour, 'MarkerSize', points);
end

function update_curve(curve, moment, lengths)
    limits = [0.5, room_for(moment.trial) + 0.5];
    set(curve.room, 'XLim', limits);
    set(curve.goal, 'XData', limits);
    running = moment.trial;
    if running <= numel(lengths)
        running = NaN;                                 % it has ended
    end
    set(curve.running, 'XData', running, 'YData', moment.step);
    if ~isempty(lengths)
        [most, place_of_most] = max(lengths);
        set(curve.ended, 'XData', 1:numel(lengths), 'YData', lengths);
        set(curve.longest, 'XData', place_of_most, 'YData', most);
    end
end

function handle = shape(world, points, colour)
    handle = patch('Parent', world, 'Vertices', points, 'Faces', 1:size(points, 1), ...
        'FaceColor', colour, 'EdgeColor', 'none');
end

function handle = write(world, at, words, pixels, side)
    c = upright.internal.colours();
    handle = text(at(1), at(2), words, 'Parent', world, 'Color', c.ink, ...
        'FontSize', upright.internal.font_size(get(world, 'Parent'), pixels), ...
        'HorizontalAlignment', side, 'VerticalAlignment', 'middle');
end

function place(handle, points, at)
    set(handle, 'Vertices', points + at);
end

function count = room_for(trial)
    % The trials that the curve has room for: 10, 20, 50, 100 ...
    counts = [1; 2; 5] * 10 .^ (1:6);
    count = min(counts(counts >= trial));
end

function points = bar(left, right, bottom, top)
    points = [left bottom; right bottom; right top; left top];
end

function points = disc(radius)
    angle = (0:23)' * (pi / 12);
    points = radius * [cos(angle), sin(angle)];
end

function points = rod(length, radius)
    % Upright, with round ends.
    angle = linspace(0, pi, 13)';
    cap = radius * [cos(angle), sin(angle)];
    points = [cap + [0, length]; -cap];
end

function points = rounded(sides, radius)
    angle = linspace(0, pi / 2, 7)';
    corner = radius * [cos(angle), sin(angle)];
    inner = sides + radius * [1 -1 1 -1];
    points = [corner + inner([2 4]); [-corner(:, 2), corner(:, 1)] + inner([1 4]); ...
        -corner + inner([1 3]); [corner(:, 2), -corner(:, 1)] + inner([2 3])];
end
