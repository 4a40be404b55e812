function path = built_mex()
%BUILT_MEX  Where the compiled C of Q-learning is; empty if upright.build_mex has not made it, or
%   its sources are newer, of which a warning tells.
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
