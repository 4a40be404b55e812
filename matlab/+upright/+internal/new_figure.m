function window = new_figure(shown, width, height)
%NEW_FIGURE  A white figure without menus: a window, or one to be written to a file.
%   window = upright.internal.new_figure(shown, width, height) has the given size in pixels. In
%   Octave, it uses the suitable graphics toolkit: gnuplot draws without a display, but does not
%   support keys. The user's toolkit and current figure do not change. If the figure is to be
%   shown but there is no display, an error is raised.
%
%   Example:
%     window = upright.internal.new_figure(false, 640, 400);
%     delete(window);
%
%   See also upright.internal.picture_of.
    current = get(0, 'CurrentFigure');
    tidy = onCleanup(@() make_current(current));
    if shown
        require_display();
    end
    if exist('OCTAVE_VERSION', 'builtin') > 0
        kit = toolkit_for(shown);
        before = graphics_toolkit();
        quiet = warning('off', 'Octave:gnuplot-graphics');    % that gnuplot cannot do it all
        tidy_toolkit = onCleanup(@() restore_toolkit(before, quiet));
        graphics_toolkit(kit);
    end
    states = {'off', 'on'};
    place = [100 100 width height];
    if shown
        screen = get(0, 'ScreenSize');
        place(1:2) = max(1, round((screen(3:4) - place(3:4)) / 2));
    end
    window = figure('Visible', states{1 + shown}, 'Units', 'pixels', 'Position', place, ...
        'Color', 'w', 'InvertHardcopy', 'off', 'NumberTitle', 'off', 'MenuBar', 'none', ...
        'ToolBar', 'none');
end

function require_display()
    seen = ~strcmp(get(0, 'DefaultFigureVisible'), 'off');
    if exist('OCTAVE_VERSION', 'builtin') > 0
        seen = seen && have_window_system();
    else
        seen = seen && ~isequal(get(0, 'ScreenSize'), [1 1 1 1]);    % as with -nodisplay
    end
    if ~seen
        error('upright:noDisplay', ['there is no display for a window; give the option ' ...
            '''file'', or on Linux start `xvfb-run -a octave`']);
    end
end

function kit = toolkit_for(shown)
    if shown
        suitable = {'qt', 'fltk'};
    elseif have_window_system()
        suitable = {'qt', 'gnuplot'};
    else
        suitable = {'gnuplot'};
    end
    available = available_graphics_toolkits();
    for k = 1:numel(suitable)
        if any(strcmp(suitable{k}, available))
            kit = suitable{k};
            return
        end
    end
    if shown
        error('upright:noDisplay', ['this Octave opens no windows that know keys; give the ' ...
            'option ''file'', or start `octave` and not `octave-cli`']);
    end
    error('upright:noDisplay', ['this Octave draws neither on a display nor by gnuplot; ' ...
        'install gnuplot, or on Linux start `xvfb-run -a octave`']);
end

function restore_toolkit(name, warnings)
    graphics_toolkit(name);
    warning(warnings);
end

function make_current(window)
    if ~isempty(window) && ishghandle(window)
        set(0, 'CurrentFigure', window);
    end
end

%!test
%! before = graphics_toolkit ();
%! window = upright.internal.new_figure (false, 320, 200);
%! unwind_protect
%!   assert (get (window, 'visible'), 'off');
%!   assert (get (window, 'position')(3:4), [320 200]);
%!   assert (graphics_toolkit (), before);
%! unwind_protect_cleanup
%!   delete (window);
%! end_unwind_protect
%!testif ; ! have_window_system ()
%! fail ('upright.internal.new_figure (true, 320, 200)', 'give the option ''file''');
