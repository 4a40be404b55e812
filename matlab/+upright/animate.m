function result = animate(agent, varargin)
%ANIMATE  Watch a cart-pole learn to balance, in a window or in a file.
%   result = upright.animate(agent) shows the learner, 'q-learning' or 'reinforce', as it pushes
%   the cart, falls and learns, and how many steps each trial lasted. Keys, or clicks on their
%   names in the window: + and - change the speed, the space bar pauses, q or Esc stops, as does
%   closing the window. result is what upright.q_learning returns; if the run was stopped, it
%   contains the trials that had ended.
%   result = upright.animate(agent, name, value, ...) takes the options of upright.q_learning or
%   upright.reinforce ('noise', 'start', 'steps', 'trials', 'seed', 'run', 'settings', 'watch'),
%   learns exactly as they do, and has these further options:
%
%     'speed'     speed relative to real time, in which a step takes 0.02 s (default 1). In a
%                 window, Inf shows the learner as fast as it learns
%     'file'      '' for a window (default), or a file, which needs no display:
%                   'learning.gif'       an animation
%                   'picture%05d.png'    a file for each picture, numbered from 1
%                   a folder             the same, named frame-00001.png ...
%                   'learning.png'       only the last picture
%     'frames'    number of pictures to stop after (default: 200 in a file, which is 8 seconds;
%                 Inf in a window)
%
%   There are 25 pictures a second at any speed, or one for each step if steps take longer than
%   that. A window shows fewer pictures if drawing is slow. A fall is always shown.
%
%   Example:
%     upright.animate('q-learning', 'noise', 'gaussian-0.1', 'steps', 3000, 'speed', 5);
%     upright.animate('reinforce', 'steps', 500, 'speed', 10, 'file', 'learning.gif');
%
%   See also upright.q_learning, upright.reinforce, upright.plot_learning.
    upright.internal.require_one_of('agent', agent, {'q-learning', 'reinforce'});
    [own, passed] = own_options(varargin);
    [chosen, task] = upright.internal.begin_run(agent, passed);
    about = sprintf('%s    noise: %s', agent, chosen.noise);
    in_window = isempty(own.file);
    finer = 2 - in_window;                             % for smooth edges in files
    current = get(0, 'CurrentFigure');
    window = upright.internal.new_figure(in_window, 640 * finer, 400 * finer);
    tidy = onCleanup(@() close_up(window, current));
    try
        draw = upright.internal.scene(window, task.parameters, about, task.steps, finer);
        if in_window
            set(window, 'Name', sprintf('Upright: %s, %s', agent, chosen.noise));
            add_controls(window);
            result = show(window, draw, agent, passed, chosen.watch, task, own);
        else
            result = record(window, draw, agent, passed, chosen.watch, task, own, finer);
        end
    catch problem
        clear('tidy');
        rethrow(problem);
    end
    % Octave 7 would not do so by itself: handles of nested functions keep the variables of all
    % functions that were at work when they were made.
    clear('tidy');
end

% ------------------------------------------------------------------------------------- options

function [own, passed] = own_options(pairs)
    % Those of this function, checked, and the others, for the learner.
    mine = false(size(pairs));
    for k = 1:2:numel(pairs) - 1
        mine(k:k + 1) = ischar(pairs{k}) && any(strcmp(pairs{k}, {'speed', 'file', 'frames'}));
    end
    passed = pairs(~mine);
    own = upright.internal.options(struct('speed', 1, 'file', '', 'frames', []), pairs(mine));
    in_window = ischar(own.file) && isempty(own.file);
    if ~(in_window && isequal(own.speed, Inf))
        upright.internal.require('speed', own.speed, 0, 1e6, 'above');
    end
    if in_window
        most = Inf;
        limit = 1e9;
    else
        own.file = check_file(own.file);
        most = 200;
        limit = 1e6;
        if strcmp(own.file(end - 3:end), '.gif')
            limit = 1000;                              % held in memory, in Octave 4 MB each
        end
    end
    if isempty(own.frames)
        own.frames = most;
    elseif ~(in_window && isequal(own.frames, Inf))
        upright.internal.require('frames', own.frames, 1, limit, 'whole');
    end
end

function file = check_file(file)
    if ischar(file) && exist(file, 'dir') == 7
        file = fullfile(file, 'frame-%05d.png');
    end
    upright.internal.check_output('file', file, {'.gif', '.png'});
    [~, name, ending] = fileparts(file);
    numbered = any(file == '%');
    form = '^[^%]*%\d*d[^%]*$';
    if numbered && (~strcmp(ending, '.png') || isempty(regexp(name, form, 'once')) ...
            || sum(file == '%') > 1)
        error('upright:badValue', ['file is %s; it may have one percent sign, in the name of a ' ...
            '.png, as frame-%%05d.png'], upright.internal.shown(file));
    end
end

function result = learn(agent, passed, watch)
    if strcmp(agent, 'q-learning')
        result = upright.q_learning(passed{:}, 'watch', watch);
    else
        result = upright.reinforce(passed{:}, 'watch', watch);
    end
end

% ---------------------------------------------------------------------------------------- file

function result = record(window, draw, agent, passed, watch, task, own, finer)
    % The time of a picture is counted, not measured. A GIF counts hundredths of a second.
    step_time = task.parameters.time_step / own.speed;
    period = round(100 * max(0.04, step_time)) / 100;
    [take, finish] = upright.internal.film(window, own.file, period, finer);
    steps = 0;
    due = 0;                                           % the next picture comes after these steps
    pictures = 0;
    lengths = [];
    shown = [];                                        % the moment that the next picture shows
    result = learn(agent, passed, @watch_step);
    if ~isempty(shown)
        take_picture();                                % how it ended
    end
    finish();

    function go_on = watch_step(moment)
        steps = steps + 1;
        [shown, lengths] = look(moment, task.steps, shown, lengths);
        if steps > due
            take_picture();
            due = due + period / step_time;
        end
        go_on = pictures < own.frames && (isempty(watch) || watch(moment));
    end

    function take_picture()
        draw(shown, lengths, speed_note(own.speed));
        take();
        pictures = pictures + 1;
        shown = [];
    end
end

function [shown, lengths] = look(moment, steps, shown, lengths)
    % Keep the newest moment for the next picture, but none that comes after a fall; and the
    % lengths of trials that have ended.
    if isempty(shown) || ~shown.fallen
        shown = moment;
    end
    if moment.fallen || moment.step >= steps
        lengths(end + 1) = moment.step;
    end
end

function told = speed_note(speed)
    told = sprintf('    speed: %g', speed);
    if isinf(speed)
        told = '    speed: all it can';
    end
end

% -------------------------------------------------------------------------------------- window

function result = show(window, draw, agent, passed, watch, task, own)
    PERIOD = 0.04;                                     % from picture to picture [s]
    PATIENCE = 0.25;                                   % if later than this, reset the clock [s]
    control = struct('speed', own.speed, 'paused', false, 'stopped', false);
    began = tic();
    mark = 0;                                          % the clock was set then [s],
    mark_steps = 0;                                    % after this many steps
    due = 0;                                           % when the next picture is [s]
    changed = false;                                   % by a key, since the last picture
    steps = 0;
    pictures = 0;
    lengths = [];
    shown = [];                                        % the moment that the next picture shows
    last = [];                                         % the one that is seen
    result = learn(agent, passed, @watch_step);
    leave();

    function go_on = watch_step(moment)
        steps = steps + 1;
        [shown, lengths] = look(moment, task.steps, shown, lengths);
        its_time = mark + (steps - mark_steps) * task.parameters.time_step / control.speed;
        late = toc(began) > its_time + PATIENCE;
        if late || its_time >= due
            last = shown;
            shown = [];
            pictures = pictures + 1;
            update();
            wait_until(its_time);
            if late
                set_clock();
            end
            due = max(toc(began), due) + PERIOD;
        end
        go_on = ~control.stopped && pictures < own.frames && (isempty(watch) || watch(moment));
    end

    function update()
        if ishghandle(window)
            note = speed_note(control.speed);
            if control.paused
                note = '    paused';
            end
            draw(last, lengths, note);
            drawnow();                                 % handles keys and clicks
        end
        changed = false;
        obey();
    end

    function obey()
        keys = keys_of(window);
        for k = 1:numel(keys)
            control = upright.internal.press(control, keys(k));
        end
        if ~isempty(keys)
            changed = true;
            set_clock();
        end
    end

    function wait_until(its_time)
        while ~control.stopped && (control.paused || changed || toc(began) < its_time)
            if changed
                its_time = 0;
                update();
            end
            pause(min(max(its_time - toc(began), 0.005), 0.03));
            obey();
        end
    end

    function set_clock()
        mark = toc(began);
        mark_steps = steps;
    end

    function leave()
        % A window that was not closed stays open, like any other.
        if ~control.stopped && ~isempty(shown)
            last = shown;
            update();
        end
        if ~control.stopped
            delete(findobj(window, 'Tag', 'buttons'));
            set(window, 'KeyPressFcn', '', 'CloseRequestFcn', 'closereq', 'Tag', 'left');
            drawnow();
        end
    end
end

% Pressed keys wait in the window's UserData until the loop reads them.

function add_controls(window)
    set(window, 'UserData', '', 'KeyPressFcn', @keep_key, 'CloseRequestFcn', @keep_end);
    c = upright.internal.colours();
    room = axes('Parent', window, 'Units', 'normalized', 'Position', [0 0.9 1 0.1], ...
        'XLim', [0 640], 'YLim', [0 40], 'Visible', 'off', 'Tag', 'buttons');
    keys = {'-', '+', ' ', 'q'};
    names = {'- slower', '+ faster', 'space: pause', 'q: stop'};
    places = [402 462 532 600];
    for k = 1:4
        text(places(k), 16, names{k}, 'Parent', room, 'UserData', keys{k}, ...
            'ButtonDownFcn', @keep_click, 'Color', c.cart, 'BackgroundColor', c.faint, ...
            'Margin', 4, 'FontSize', upright.internal.font_size(window, 11), ...
            'HorizontalAlignment', 'center', 'VerticalAlignment', 'baseline');
    end
end

function keep_key(window, event)
    key = event.Character;
    if strcmp(event.Key, 'escape')
        key = 'q';
    end
    set(window, 'UserData', [get(window, 'UserData'), key]);
end

function keep_click(button, ~)
    window = ancestor(button, 'figure');
    set(window, 'UserData', [get(window, 'UserData'), get(button, 'UserData')]);
end

function keep_end(window, ~)
    if any(get(window, 'UserData') == 'q')
        delete(window);                                % nobody is watching: the run was interrupted
    else
        set(window, 'UserData', [get(window, 'UserData'), 'q']);
    end
end

function keys = keys_of(window)
    keys = 'q';                                        % a window that was deleted
    if ishghandle(window)
        keys = get(window, 'UserData');
        set(window, 'UserData', '');
    end
end

function close_up(window, current)
    if ishghandle(window) && ~strcmp(get(window, 'Tag'), 'left')
        delete(window);
    end
    if ~isempty(current) && ishghandle(current)
        set(0, 'CurrentFigure', current);
    end
end

%!function go_on = type_in (moment, before, keys)
%!  go_on = true;
%!  if (moment.step == 1)
%!    window = setdiff (get (0, 'children'), before);
%!    type = get (window, 'keypressfcn');
%!    type (window, struct ('Character', keys{moment.trial}, 'Key', ''));
%!  end
%!endfunction
%!test  # as many pictures as wanted, each another, and nothing else is left or changed
%! file = [tempname() '.gif'];
%! before = {graphics_toolkit(), get(0, 'children')};
%! unwind_protect
%!   upright.animate ('q-learning', 'frames', 4, 'speed', 4, 'seed', 1, 'file', file);
%!   frames = imread (file, 'frames', 'all');
%!   info = imfinfo (file);
%! unwind_protect_cleanup
%!   delete (file);
%! end_unwind_protect
%! assert (size (frames, 4), 4);
%! assert (size (frames)(1:2), [400 640]);
%! for k = 2:4, assert (! isequal (frames(:, :, :, k), frames(:, :, :, k - 1))); end
%! assert ([info(1:3).DelayTime], [4 4 4]);              # hundredths of a second
%! assert ({graphics_toolkit(), get(0, 'children')}, before);
%!test  # what is learned does not hang on who looks; each picture is a file
%! folder = tempname ();
%! mkdir (folder);
%! unwind_protect
%!   watched = upright.animate ('q-learning', 'steps', 100, 'speed', 300, 'noise', 'gaussian-0.1', 'file', folder);
%!   assert (watched, upright.q_learning ('steps', 100, 'noise', 'gaussian-0.1'));
%!   files = dir (fullfile (folder, 'frame-*.png'));
%!   assert (numel (files), 1 + ceil ((sum (watched.lengths) - 1) / 600));
%!   pixels = imread (fullfile (folder, files(end).name));
%!   assert (size (pixels), [400 640 3]);
%!   assert (numel (unique (pixels)) > 20);
%! unwind_protect_cleanup
%!   confirm_recursive_rmdir (false, 'local');
%!   rmdir (folder, 's');
%! end_unwind_protect
%!test  # who watches can stop it, and an error leaves nothing behind
%! file = [tempname() '.png'];
%! before = get (0, 'children');
%! result = upright.animate ('reinforce', 'speed', 1000, 'file', file, 'watch', @(moment) moment.trial < 3);
%! assert (result.trials, 2);
%! assert (size (imread (file)), [400 640 3]);
%! delete (file);
%! fail ('upright.animate (''q-learning'', ''file'', file, ''watch'', @(moment) error (''seen enough''))', 'seen enough');
%! assert (! exist (file, 'file'));
%! assert (get (0, 'children'), before);
%!testif ; have_window_system () && any (strcmp (available_graphics_toolkits (), 'qt'))
%! # Keys in a window, which one that stops closes; that of a run that has ended stays.
%! before = get (0, 'children');
%! keys = {'+', '-', 'q', '', ''};
%! result = upright.animate ('q-learning', 'speed', 50, 'watch', @(moment) type_in (moment, before, keys));
%! assert (result.trials <= 4);
%! assert (get (0, 'children'), before);
%! result = upright.animate ('q-learning', 'speed', Inf, 'steps', 50);
%! assert (result.success);
%! window = setdiff (get (0, 'children'), before);
%! assert (get (window, 'closerequestfcn'), 'closereq');
%! close (window);
%!testif ; ! have_window_system ()
%! fail ('upright.animate (''q-learning'')', 'give the option ''file''');
%!error id=upright:badValue upright.animate ('random-search')
%!error <option 'colour' is unknown> upright.animate ('q-learning', 'colour', 'red', 'file', 'a.gif')
%!error <speed is 0> upright.animate ('q-learning', 'speed', 0, 'file', 'a.gif')
%!error <speed is Inf> upright.animate ('q-learning', 'speed', Inf, 'file', 'a.gif')
%!error <frames is 0.5> upright.animate ('q-learning', 'frames', 0.5, 'file', 'a.gif')
%!error <noise is 'storm'> upright.animate ('q-learning', 'noise', 'storm', 'file', 'a.gif')
%!error <in pairs> upright.animate ('q-learning', 'noise')
%!error <ending of 'a.avi'> upright.animate ('q-learning', 'file', 'a.avi')
%!error <one percent sign> upright.animate ('q-learning', 'file', 'a%d%d.png')
%!error <one percent sign> upright.animate ('q-learning', 'file', 'a%05d.gif')
%!error id=upright:cannotWrite upright.animate ('q-learning', 'file', fullfile ('no', 'such', 'a.gif'))
