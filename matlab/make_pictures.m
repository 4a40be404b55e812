function make_pictures(folder)
%MAKE_PICTURES  Generate the pictures of the MATLAB twin for the documentation.
%   make_pictures() writes them to docs/pictures; make_pictures(folder) writes them to folder:
%
%     matlab-cart-pole.png   a cart-pole that learns
%     matlab-learning.gif    how it falls, and then balances
%     matlab-curves.png      the learning curves of 20 runs
%
%   It takes about two minutes. From a shell, where the second looks better:
%     octave-cli --path matlab --eval make_pictures
%     xvfb-run -a octave --no-gui --path matlab --eval make_pictures
%
%   Example:
%     make_pictures('.');
%
%   See also upright.animate, upright.plot_learning.
    if nargin < 1
        here = fileparts(mfilename('fullpath'));
        folder = fullfile(here, '..', 'docs', 'pictures');
    end
    show = @(name, varargin) upright.animate('q-learning', 'seed', 17, 'file', ...
        fullfile(folder, name), varargin{:});
    show('matlab-cart-pole.png', 'frames', 186);
    show('matlab-learning.gif', 'steps', 300, 'speed', 5);
    results = upright.run_trials('q-learning', 'noise', 'gaussian-0.1');
    upright.plot_learning(results, 'file', fullfile(folder, 'matlab-curves.png'));
end
