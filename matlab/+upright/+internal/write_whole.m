function write_whole(path, write)
%WRITE_WHOLE  Write a file completely, or leave it unchanged.
%   upright.internal.write_whole(path, write) calls write(part), which writes a file under another
%   name in the same folder, and then renames it atomically. If write is empty, nothing is left
%   behind: the function only checks whether the folder is writable.
%
%   Example:
%     upright.internal.write_whole('ones.png', @(part) imwrite(ones(9), part));
    [folder, name, ending] = fileparts(path);
    [~, unique] = fileparts(tempname());
    part = fullfile(folder, [name '.' unique ending]);
    tidy = onCleanup(@() remove(part));
    [handle, why] = fopen(part, 'w');
    if handle == -1
        refuse(path, why);
    end
    fclose(handle);
    if isempty(write)
        return
    end
    write(part);
    [done, why] = movefile(part, path, 'f');
    if ~done
        refuse(path, why);
    end
end

function refuse(path, why)
    error('upright:cannotWrite', '%s cannot be written. %s', path, why);
end

function remove(file)
    if exist(file, 'file')
        delete(file);
    end
end

%!test
%! folder = tempname ();
%! mkdir (folder);
%! path = fullfile (folder, 'a.png');
%! unwind_protect
%!   upright.internal.write_whole (path, []);
%!   assert (numel (dir (folder)), 2);
%!   upright.internal.write_whole (path, @(part) imwrite (uint8 (ones (9)), part));
%!   assert (size (imread (path)), [9 9]);
%!   fail ('upright.internal.write_whole (path, @(part) error ("no more room"))', 'no more room');
%!   assert (size (imread (path)), [9 9]);
%!   assert (numel (dir (folder)), 3);
%! unwind_protect_cleanup
%!   delete (path);
%!   rmdir (folder);
%! end_unwind_protect
%!error id=upright:cannotWrite upright.internal.write_whole (fullfile ('no', 'such', 'a.png'), [])
