function path = built_mex()
%BUILT_MEX  Where the compiled C of Q-learning is; empty if upright.build_mex has not made it.
%
%   Example:
%     upright.internal.built_mex()
    folder = fileparts(mfilename('fullpath'));
    path = fullfile(folder, ['q_learning_mex.' mexext()]);
    if ~exist(path, 'file')
        path = '';
    end
end
