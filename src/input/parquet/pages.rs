//! The pages of a column, unpacked here: in Rust alone, and never to more bytes than the file declares for the column.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::sync::Arc;

use parquet::basic::{Compression, Encoding};
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::data_type::FixedLenByteArray;
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::reader::{ChunkReader, Length};
use parquet::file::serialized_reader::SerializedPageReader;

use super::thrift;
use crate::input::account::{Account, Excess, Loan};
use crate::input::bytes::zstd;

/// The file of the pages. Reading on at its end is an error here: the crate passes over the elements of a damaged
/// header one by one, as many as it declares, also where there are none left.
pub(super) struct Disk(pub(super) File);

/// Reads up to the end of the file, and no further.
pub(super) struct UpToEnd(File);

impl Read for UpToEnd {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        match self.0.read(buffer)? {
            0 if !buffer.is_empty() => Err(std::io::ErrorKind::UnexpectedEof.into()),
            count => Ok(count),
        }
    }
}

impl Length for Disk {
    fn len(&self) -> u64 {
        self.0.len()
    }
}

impl ChunkReader for Disk {
    type T = BufReader<UpToEnd>;

    fn get_read(&self, start: u64) -> Result<Self::T> {
        let mut file = self.0.try_clone()?;
        file.seek(SeekFrom::Start(start))?;
        Ok(BufReader::new(UpToEnd(file)))
    }
    fn get_bytes(&self, start: u64, length: usize) -> Result<bytes::Bytes> {
        self.0.get_bytes(start, length)
    }
}

/// The pages of one column of one row group, in order.
pub(super) struct Pages {
    /// As they are stored.
    stored: SerializedPageReader<Disk>,
    compression: Compression,
    /// Bytes that the pages may still have, unpacked.
    left: usize,
    dictionary: bool,
    account: Account,
    /// For the dictionary, and for the page that is being read.
    kept: [Option<Loan>; 2],
}

impl From<Excess> for ParquetError {
    fn from(excess: Excess) -> ParquetError {
        ParquetError::General(excess.to_string())
    }
}

fn fault(what: impl Into<String>) -> ParquetError {
    ParquetError::General(what.into())
}

impl Pages {
    pub(super) fn open(
        file: &Arc<Disk>,
        column: &ColumnChunkMetaData,
        rows: usize,
        account: &Account,
    ) -> Result<Pages> {
        let starts = [column.dictionary_page_offset(), Some(column.data_page_offset())];
        let start = starts.into_iter().flatten().min().unwrap_or(-1);
        let end = start.checked_add(column.compressed_size()).and_then(|end| u64::try_from(end).ok());
        let end = end.filter(|end| *end <= file.len() && column.compressed_size() >= 0);
        let (Some(end), false) = (end, starts.iter().flatten().any(|start| *start < 4)) else {
            return Err(fault("a column lies outside the file"));
        };
        match thrift::headers_end(&file.0, start as u64, end, account) {
            Ok(()) => {}
            Err(thrift::Refusal::Endless) => return Err(fault("the header of a page declares more than there is")),
            Err(thrift::Refusal::Excess(excess)) => return Err(excess.into()),
        }
        let compression = column.compression();
        let left = usize::try_from(column.uncompressed_size()).map_err(|_| fault("a column of negative size"))?;
        // told that nothing is compressed, it hands out pages as they are stored
        let stored = column.clone().into_builder().set_compression(Compression::UNCOMPRESSED).build()?;
        Ok(Pages {
            stored: SerializedPageReader::new(file.clone(), &stored, rows, None)?,
            compression,
            left,
            dictionary: false,
            account: account.clone(),
            kept: [None, None],
        })
    }

    fn unpack(&mut self, page: Page) -> Result<Page> {
        let whole = |pages: &mut Pages, bytes: &[u8]| {
            let out = pages.decompress(bytes)?;
            pages.account.work((bytes.len() + out.len()) as u64)?;
            Ok::<_, ParquetError>(out)
        };
        self.kept[1] = None;
        let stored = page.buffer().len();
        let indices = [Encoding::RLE_DICTIONARY, Encoding::PLAIN_DICTIONARY].contains(&page.encoding());
        match page.is_dictionary_page() {
            true => self.dictionary = true,
            false if indices && !self.dictionary => return Err(fault("a page whose dictionary is not there")),
            false => {}
        }
        let page = match page {
            Page::DictionaryPage { buf, num_values, encoding, is_sorted } => {
                let buf = whole(self, &buf)?;
                // each value has a byte, and room is made for all of them at once
                if num_values as usize > buf.len() {
                    return Err(fault("a dictionary of fewer bytes than values"));
                }
                // unpacked into values of up to so many bytes
                self.kept[0] = Some(self.account.lend(num_values as u64 * size_of::<FixedLenByteArray>() as u64)?);
                Page::DictionaryPage { buf: buf.into(), num_values, encoding, is_sorted }
            }
            Page::DataPage { buf, num_values, encoding, def_level_encoding, rep_level_encoding, .. } => {
                let buf = whole(self, &buf)?.into();
                Page::DataPage { buf, num_values, encoding, def_level_encoding, rep_level_encoding, statistics: None }
            }
            Page::DataPageV2 {
                buf,
                num_values,
                encoding,
                num_nulls,
                num_rows,
                def_levels_byte_len,
                rep_levels_byte_len,
                is_compressed,
                ..
            } => {
                // the levels stand before the values and are not compressed
                let levels = def_levels_byte_len as usize + rep_levels_byte_len as usize;
                let (levels, values) =
                    buf.split_at_checked(levels).ok_or_else(|| fault("a page that ends inside its levels"))?;
                let values = if is_compressed && !values.is_empty() { whole(self, values)? } else { values.to_vec() };
                let buf = [levels, &values].concat().into();
                Page::DataPageV2 {
                    buf,
                    num_values,
                    encoding,
                    num_nulls,
                    num_rows,
                    def_levels_byte_len,
                    rep_levels_byte_len,
                    is_compressed: false,
                    statistics: None,
                }
            }
        };
        self.kept[1] = Some(self.account.lend((stored + page.buffer().len()) as u64)?);
        Ok(page)
    }

    fn decompress(&mut self, bytes: &[u8]) -> Result<Vec<u8>> {
        // what is unpacked grows by doubling
        let most = self.left.min(usize::try_from(self.account.left() / 2).unwrap_or(usize::MAX));
        let read = |reader: &mut dyn Read| {
            let mut out = Vec::new();
            match reader.take(most as u64 + 1).read_to_end(&mut out) {
                Ok(_) => Ok(out),
                Err(error) => Err(fault(format!("a page cannot be unpacked ({error})"))),
            }
        };
        let out = match self.compression {
            Compression::UNCOMPRESSED => bytes.to_vec(),
            Compression::SNAPPY => {
                let size = snap::raw::decompress_len(bytes).map_err(|error| fault(error.to_string()))?;
                self.account.room(size as u64)?;
                if size > self.left {
                    return Err(fault("a page larger than its column"));
                }
                snap::raw::Decoder::new().decompress_vec(bytes).map_err(|error| fault(error.to_string()))?
            }
            Compression::GZIP(_) => read(&mut flate2::read::MultiGzDecoder::new(bytes))?,
            Compression::ZSTD(_) => read(&mut zstd(bytes, most as u64).map_err(fault)?)?,
            Compression::LZ4_RAW => {
                // a block does not say its size; a byte of it makes at most 255
                let mut out = vec![0; most.min(bytes.len().saturating_mul(255))];
                let size =
                    lz4_flex::block::decompress_into(bytes, &mut out).map_err(|error| fault(error.to_string()))?;
                out.truncate(size);
                out
            }
            other => {
                let name = format!("{other}");
                let name = name.split('(').next().unwrap_or_default();
                return Err(fault(format!(
                    "compressed with {name}, which is not read; write it with zstd, snappy, gzip or none"
                )));
            }
        };
        if out.len() > most && most < self.left {
            return Err(Excess::Memory.into());
        }
        self.left = self.left.checked_sub(out.len()).ok_or_else(|| fault("pages larger than their column"))?;
        Ok(out)
    }
}

impl Iterator for Pages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

impl PageReader for Pages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        match self.stored.get_next_page()? {
            Some(page) => self.unpack(page).map(Some),
            None => Ok(None),
        }
    }
    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        self.stored.peek_next_page()
    }
    fn skip_next_page(&mut self) -> Result<()> {
        self.stored.skip_next_page()
    }
}
