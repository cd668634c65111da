// SPDX-License-Identifier: Apache-2.0
// Maps a user of an OPC UA session to a client of the planning service.
import {createHash} from 'node:crypto';
import opcua from 'node-opcua';
import {hashPassword, isPassword} from './password.js';

const {OPCUACertificateManager, StatusCodes, UserNameIdentityToken, X509IdentityToken} = opcua;

// Found for a name that nobody has: the answer takes as long as for another one.
const NOBODY = hashPassword('');

const digestOf = (certificate) => createHash('sha256').update(certificate).digest('hex');
const firstOf = (chain) => Array.isArray(chain) ? chain[0] : chain;

export class Users {
  // `clients`: those of the configuration, each with users {NAME: password hash} and certificates,
  // SHA-256 digests of the DER form of certificates, hexadecimal.
  constructor(clients) {
    this.users = new Map();
    this.certificates = new Map();
    for (const client of clients) {
      for (const [name, hash] of Object.entries(client.users ?? {})) this.users.set(name, {hash, client: client.name});
      for (const digest of client.certificates ?? []) this.certificates.set(digest.toLowerCase(), client.name);
    }
  }

  async isValid(name, password) {
    const user = this.users.get(name);
    const is_right = await isPassword(password ?? '', user?.hash ?? NOBODY);
    return user !== undefined && is_right;
  }

  // Name of the client, undefined for a certificate that is nobody's.
  clientOfCertificate(chain) {
    return this.certificates.get(digestOf(firstOf(chain)));
  }

  // Name of the client, undefined for a user who is nobody's.
  clientOf(session) {
    const token = session?.userIdentityToken;
    if (token instanceof UserNameIdentityToken) return this.users.get(token.userName)?.client;
    if (token instanceof X509IdentityToken) return this.clientOfCertificate(token.certificateData);
    return undefined;
  }
}

// Users' certificates: the configuration's digest is what makes one trusted, and it must be valid now.
export class UserCertificates extends OPCUACertificateManager {
  constructor(folder, users) {
    super({rootFolder: folder, automaticallyAcceptUnknownCertificate: true});
    this.configured = users;
  }

  checkCertificate(chain, callback) {
    if (this.configured.clientOfCertificate(chain) === undefined) {
      callback(null, StatusCodes.BadCertificateUntrusted);
      return undefined;
    }
    // The library accepts a certificate that it has not seen before without a look at its dates.
    return super.checkCertificate(chain, (error) => error ? callback(error) : super.checkCertificate(chain, callback));
  }
}
