function path = built_mex()
%BUILT_MEX  Path of the compiled C of Q-learning; empty if upright.build_mex has not built it, or
%   if its sources are newer, in which case a warning is given.
%
%   Example:
%     upright.internal.built_mex()
    folder = fileparts(mfilename('fullpath'));
    path = fullfile(folder, ['q_learning_mex.' mexext()]);
    if ~exist(path, 'file')
        path = '';
        return
    end
    built = dir(path);
    sources = fullfile(fileparts(fileparts(folder)), 'mex');
    sources = [dir(fullfile(sources, '*.c')); dir(fullfile(sources, '*.h'))];
    if any([sources.datenum] > built.datenum)
        warning('upright:oldMex', ...
            'the compiled C is older than its sources and is not used; call upright.build_mex()');
        path = '';
    end
end
