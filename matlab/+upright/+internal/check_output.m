function check_output(name, path, endings)
%CHECK_OUTPUT  Stop with a clear error unless a file can be written there.
%   upright.internal.check_output(name, path, endings), where endings is a cell array.
%
%   Example:
%     upright.internal.check_output('file', 'learning.gif', {'.gif', '.png'})
%
%   See also upright.internal.write_whole.
    if ~ischar(path)
        error('upright:badValue', '%s is %s; it must be the name of a file', name, ...
            upright.internal.shown(path));
    end
    [folder, ~, ending] = fileparts(path);
    upright.internal.require_one_of(sprintf('the ending of %s', upright.internal.shown(path)), ...
        ending, endings);
    if ~isempty(folder) && exist(folder, 'dir') ~= 7
        error('upright:cannotWrite', '%s is %s; there is no folder %s', name, ...
            upright.internal.shown(path), folder);
    end
    upright.internal.write_whole(path, []);
end

%!error <ending of 'a.bmp' is '.bmp'; it must be one of .gif, .png> upright.internal.check_output ('file', 'a.bmp', {'.gif', '.png'})
%!error <file is 3; it must be the name> upright.internal.check_output ('file', 3, {'.gif'})
%!error <there is no folder> upright.internal.check_output ('file', fullfile ('no', 'such', 'a.gif'), {'.gif'})
