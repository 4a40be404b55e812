function control = press(control, key)
%PRESS  What a key does to an animation that runs.
%   control = upright.internal.press(control, key), where control has the fields speed, paused and
%   stopped. '+' and '-' go to the next speed of 0.1, 0.2, 0.5, 1, 2, 5 ... 1000, Inf; a blank
%   pauses and goes on; 'q' and the escape character stop. Other keys do nothing.
%
%   Example:
%     upright.internal.press(struct('speed', 1, 'paused', false, 'stopped', false), '+')
%
%   See also upright.animate.
    SPEEDS = [0.1 0.2 0.5 1 2 5 10 20 50 100 200 500 1000 Inf];
    ESCAPE = char(27);
    switch key
        case {'+', '='}                            % one key on many keyboards
            control.speed = min([SPEEDS(SPEEDS > control.speed), Inf]);
        case '-'
            control.speed = max([SPEEDS(SPEEDS < control.speed), SPEEDS(1)]);
        case ' '
            control.paused = ~control.paused;
        case {'q', ESCAPE}
            control.stopped = true;
    end
end

%!shared c
%! c = struct ('speed', 3, 'paused', false, 'stopped', false);
%!test
%! c = upright.internal.press (c, '+');    assert (c.speed, 5);
%! c = upright.internal.press (c, '-');    assert (c.speed, 2);
%! c.speed = Inf;
%! c = upright.internal.press (c, '+');    assert (c.speed, Inf);
%! c = upright.internal.press (c, '-');    assert (c.speed, 1000);
%! c.speed = 0.1;
%! c = upright.internal.press (c, '-');    assert (c.speed, 0.1);
%! c = upright.internal.press (c, ' ');    assert (c.paused);
%! c = upright.internal.press (c, ' ');    assert (! c.paused);
%! assert (isequal (upright.internal.press (c, 'x'), c));
%! assert (isequal (upright.internal.press (c, ''), c));
%! assert (! c.stopped);
%! c = upright.internal.press (c, 'q');    assert (c.stopped);
