function write_file(file, text)
%WRITE_FILE  Write a text to a file, whole or not at all.
%
%   Example:
%     upright.internal.write_file('note.txt', 'hello');
    [folder, name, ending] = fileparts(file);
    part = fullfile(folder, ['.' name ending '.part']);
    [id, why] = fopen(part, 'w');
    if id < 0
        refuse(file, why);
    end
    written = fwrite(id, text);
    closed = fclose(id);
    if written ~= numel(text) || closed ~= 0
        delete(part);
        refuse(file, 'the disk is full, or gone');
    end
    [moved, why] = movefile(part, file, 'f');
    if ~moved
        delete(part);
        refuse(file, why);
    end
end

function refuse(file, why)
    error('upright:cannotWrite', 'file is ''%s''; it cannot be written: %s', file, strtrim(why));
end
