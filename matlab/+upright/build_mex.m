function build_mex(folder)
%BUILD_MEX  Compile Q-learning: the same runs to the last bit, some thousand times as fast.
%   upright.build_mex() builds upright.internal.q_learning_mex from matlab/mex/q_learning_mex.c.
%   upright.run_trials then uses it. This requires a C compiler; without one, everything works, but
%   more slowly.
%   upright.build_mex(folder) writes it to another folder. An Octave session that has already used
%   the compiled code keeps using the old one until `clear all`.
%
%   Example:
%     upright.build_mex();
%     [lengths, balanced, table] = upright.internal.q_learning_mex(upright.parameters(), ...
%         upright.noise_case('none'), 0.05 * ones(1, 4), upright.settings('q-learning'), 1, ...
%         60000, 1000);
%
%   See also upright.q_learning, upright.run_trials.
    here = fileparts(mfilename('fullpath'));
    if nargin < 1
        folder = fullfile(here, '+internal');
    end
    if ~ischar(folder) || exist(folder, 'dir') ~= 7
        error('upright:badValue', 'folder is %s; it must be the name of a folder', ...
            upright.internal.shown(folder));
    end
    name = 'q_learning_mex';
    source = fullfile(fileparts(here), 'mex', [name '.c']);
    place = fullfile(folder, [name '.' mexext()]);

    % Build elsewhere, then copy to another name in the same folder, where renaming is atomic: a
    % call in the meantime finds a complete file, either the old one or the new one.
    [~, unique] = fileparts(tempname());
    built = fullfile(tempdir(), [unique '.' mexext()]);
    beside = [place '.' unique];
    tidy = onCleanup(@() remove({built, beside}));
    % Contraction would skip roundings, and give different bits than Python.
    options = {'-std=c99', '-ffp-contract=off'};
    if exist('OCTAVE_VERSION', 'builtin') > 0
        compile_in_octave(source, built, options);
    else
        clear('mex');                              % on Windows, a file in use cannot be replaced
        compile_in_matlab(source, built, options);
    end
    move(built, beside);
    move(beside, place);
    rehash();
    fprintf('built %s\n', place);
end

function compile_in_octave(source, built, options)
    % Not by the function mkoctfile, which keeps the compiler's messages to itself; and in two
    % steps, as in one it leaves a file behind when it fails. An option that mkoctfile does not know
    % takes the next word along, unless that is an option too.
    program = fullfile(OCTAVE_EXEC_HOME(), 'bin', 'mkoctfile');
    object = [built '.o'];
    tidy = onCleanup(@() remove({object}));
    steps = {[options, {'-O3', '-c', '-o', object, source}], {'-o', built, object}};
    for k = 1:2
        words = [{program, '--mex'}, steps{k}];
        [status, output] = system([sprintf('"%s" ', words{:}), '2>&1']);
        if status ~= 0
            refuse(output, 'Debian and Ubuntu have one in the package octave-dev');
        end
    end
end

function compile_in_matlab(source, built, options)
    [folder, name] = fileparts(built);
    try
        % -R2017b: complex numbers apart. There are none, and older releases know no other way.
        mex('-silent', '-R2017b', ['CFLAGS=$CFLAGS ' strjoin(options, ' ')], ...
            '-outdir', folder, '-output', name, source);
    catch problem
        refuse(problem.message, 'see `mex -setup C`');
    end
end

function refuse(output, advice)
    error('upright:noCompiler', ...
        'q_learning_mex.c cannot be compiled; it needs a C compiler (%s). What was said:\n%s', ...
        advice, strtrim(output));
end

function move(from, to)
    [done, why] = movefile(from, to, 'f');
    if ~done
        error('upright:cannotWrite', '%s cannot be written. %s', to, why);
    end
end

function remove(files)
    for k = 1:numel(files)
        if exist(files{k}, 'file')
            delete(files{k});
        end
    end
end

%!function folder = workshop ()
%!  folder = tempname ();
%!  mkdir (folder);
%!endfunction
%!function clear_up (folder)
%!  rmpath (folder);
%!  clear ('q_learning_mex');
%!  left = fullfile (folder, 'q_learning_mex.mex');
%!  if (exist (left, 'file')), delete (left); end
%!  rmdir (folder);
%!endfunction
%!function varargout = changed (place, value, field)
%!  % A short run with one argument, or one field of it, changed.
%!  given = {upright.parameters(), upright.noise_case('none'), 0.05 * ones(1, 4), upright.settings('q-learning'), 1, 10, 3};
%!  if (nargin == 3)
%!    given{place}.(field) = value;
%!  elseif (nargin == 2)
%!    given{place} = value;
%!  end
%!  [varargout{1:nargout}] = q_learning_mex (given{:});
%!endfunction
%!testif ; ! isempty (file_in_path (getenv ("PATH"), "mkoctfile")) && ! isempty (file_in_path (getenv ("PATH"), "gcc"))
%! folder = workshop ();
%! addpath (folder);
%! unwind_protect
%!   here = dir (pwd ());
%!   said = evalc ('upright.build_mex (folder)');
%!   assert (strncmp (said, 'built ', 6));
%!   assert (numel (dir (folder)), 3);        # and nothing else but . and ..
%!   assert (numel (dir (pwd ())), numel (here));
%!   # The run of the readable twin, whatever disturbs it.
%!   [~, noises] = upright.noise_case ();
%!   noises{end + 1} = 'all-10';
%!   for label = {'default', 'as-published'}
%!     s = upright.settings ('q-learning', label{1});
%!     for k = 1:numel (noises)
%!       result = upright.q_learning ('noise', noises{k}, 'settings', s, 'steps', 40, 'trials', 9, 'run', k);
%!       [lengths, balanced, table] = q_learning_mex (upright.parameters (), upright.noise_case (noises{k}), 0.05 * ones (1, 4), s, k, 40, 9);
%!       assert (lengths, result.lengths);
%!       assert (balanced, result.success);
%!       policy = upright.internal.table_policy (s, table);
%!       assert (policy.probabilities, result.policy.probabilities);
%!     end
%!   end
%!   # Values of other types that are what they must be.
%!   lengths = changed ();
%!   assert (changed (6, int32 (10)), lengths);
%!   assert (changed (4, 1, 'mirrored'), lengths);
%!   for edges = {[], zeros(1, 0), -1:1, eye(1, 1)}
%!     s = upright.settings ('q-learning');
%!     s.mirrored = false;
%!     s.theta_edges = edges{1};
%!     [~, ~, table] = changed (4, s);
%!     assert (numel (table), 2 * 3 * 2 * 8 * (numel (edges{1}) + 1));
%!   end
%!   # Whatever is no such value is named.
%!   s = upright.settings ('q-learning');
%!   p = upright.parameters ();
%!   bad = {{1, 0}, {1, p([1 1])}, {1, p([])}, {1, rmfield(p, 'force')}, {1, -1, 'gravity'}, ...
%!     {1, 0, 'cart_mass'}, {1, NaN, 'force'}, {1, Inf, 'force'}, {1, 'a', 'force'}, ...
%!     {1, [1 2], 'force'}, {1, 2i, 'force'}, {1, sparse(2), 'force'}, {2, struct()}, ...
%!     {2, -0.1, 'angle'}, {3, 1}, {3, ones(4, 1)}, {3, single(ones(1, 4))}, {3, sparse(ones(1, 4))}, ...
%!     {3, [0 0 0 NaN]}, {3, {0 0 0 0}}, {4, struct()}, {4, 2, 'learning_rate'}, {4, 1.5, 'replay_passes'}, ...
%!     {4, 0, 'replay_size'}, {4, 1e8, 'replay_size'}, {4, -1, 'jitter'}, {4, 0.5, 'mirrored'}, ...
%!     {4, [1 0], 'x_edges'}, {4, [0 0], 'x_edges'}, {4, [0 1], 'x_edges'}, {4, [NaN 1], 'x_edges'}, ...
%!     {4, [-1e7 1e7], 'x_edges'}, {4, {}, 'x_edges'}, {4, '', 'x_edges'}, {4, [-1; 1], 'x_edges'}, ...
%!     {4, -50:50, 'x_edges'}, {4, sparse([-1 1]), 'x_edges'}, {4, int8([-1 1]), 'x_edges'}, ...
%!     {4, zeros(1, 2, 2), 'x_edges'}, {4, @sin, 'x_edges'}, {5, -1}, {5, 2 ^ 32}, {5, 0.5}, ...
%!     {6, 0}, {6, 1e10}, {6, []}, {7, 0}, {7, 2e6}, {7, '12'}};
%!   for k = 1:numel (bad)
%!     try
%!       changed (bad{k}{:});
%!       said = 'nothing';
%!     catch problem
%!       said = problem.identifier;
%!     end
%!     assert (said, 'upright:badValue', sprintf ('bad value %d', k));
%!   end
%!   for name = {'x_edges', 'x_dot_edges', 'theta_edges', 'theta_dot_edges'}
%!     s.(name{1}) = -49:49;
%!   end
%!   fail ('changed (4, s)', 'edges make 100000000 boxes');
%!   fail ('q_learning_mex ()', '0 values were given');
%!   fail ('changed (4, 2, ''discount'')', 'discount is 2; it must be a number, at least 0 and at most 1');
%!   fail ('changed (6, ones (2, 3))', 'steps is double of 2 by 3; it must be a whole number, at least 1 and at most 1000000000');
%! unwind_protect_cleanup
%!   clear_up (folder);
%! end_unwind_protect
%!test  # without a compiler nothing is built, and the error says what is missing
%! folder = workshop ();
%! addpath (folder);
%! path_before = getenv ('PATH');
%! unwind_protect
%!   setenv ('PATH', folder);
%!   fail ('upright.build_mex (folder)', 'needs a C compiler .*octave-dev');
%!   setenv ('PATH', path_before);
%!   assert (numel (dir (folder)), 2);
%! unwind_protect_cleanup
%!   setenv ('PATH', path_before);
%!   rmpath (folder);
%!   rmdir (folder);
%! end_unwind_protect
%!error <folder is 'nowhere'> upright.build_mex ('nowhere')
