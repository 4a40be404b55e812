function failed = run_tests()
%RUN_TESTS  Run the tests at the end of each file, in GNU Octave.
%   failed = run_tests() returns the number of failed tests, and prints a line for each file and the
%   total. From a shell, where the exit status is 1 if a test failed:
%
%     octave-cli --eval "addpath matlab; exit(run_tests() > 0)"
%
%   Example:
%     run_tests();
    folder = fileparts(mfilename('fullpath'));
    passed = 0;
    failed = 0;
    files = [dir(fullfile(folder, '+upright', '*.m'))
             dir(fullfile(folder, '+upright', '+internal', '*.m'))];
    for k = 1:numel(files)
        file = fullfile(files(k).folder, files(k).name);
        if isempty(regexp(fileread(file), '^%!', 'once', 'lineanchors'))
            continue
        end
        began = tic();
        [good, all] = test(file, 'quiet');
        fprintf('%-24s %2d of %2d tests passed, %4.1f s\n', files(k).name, good, all, toc(began));
        fflush(stdout());
        passed = passed + good;
        failed = failed + all - good;
    end
    fprintf('%d passed, %d failed\n', passed, failed);
end
